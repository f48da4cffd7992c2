#!/bin/sh
# What programs of can-utils print and how they end: can-utils.sh INTERFACE FOLDER, on vcan in the guest of scripts/vcan-vm and under
# `bench can`. Each case is a file in FOLDER; time stamps are left out of them. INTERFACE carries nothing else meanwhile.

interface=$1
folder=$2
mkdir -p "$folder"
cd "$folder" || exit 2

# start NAME COMMAND...: in the background, once it has shown a frame of 7E0, which is sent until then.
start() {
    name=$1
    shift
    "$@" >"$name.raw" 2>&1 &
    listener=$!
    until [ -s "$name.raw" ]; do
        cansend "$interface" 7E0#
        sleep 0.1
    done
}

# finish: sends 7E1, and ends the listener once it has shown it; leaves its frames without those two.
finish() {
    cansend "$interface" 7E1#
    until grep -q -e ' 7E1 ' -e '7E1#' "$name.raw"; do sleep 0.1; done
    kill "$listener"
    wait "$listener"
    sed -e '/7E[01]/d' -e 's/^ *([0-9.]*) */(time) /' "$name.raw" >"$name"
    rm "$name.raw"
}

send_all() {
    for frame in 123#DEADBEEF 124# 1FF#1122334455667788 7FF#R 00000123#01 12345678#R4 123#5; do
        cansend "$interface" "$frame" || echo "code $?"
    done
}

start all candump "$interface"
send_all >sent 2>&1
finish

start filters candump "$interface,123:7FF,7E0:7F0"
send_all >/dev/null 2>&1
finish

start inverted candump "$interface,123~7FF"
send_all >/dev/null 2>&1
finish

start joined candump "$interface,123~7FF,124~7FF,j"
send_all >/dev/null 2>&1
finish

start errors candump "$interface,0:0,#FFFFFFFF"
cansend "$interface" 20000040#0000000000000000
cansend "$interface" 20000004#0004000000000000
finish

start own candump -x "$interface"
send_all >/dev/null 2>&1
finish

start log candump -L "$interface"
send_all >/dev/null 2>&1
finish

start any candump -d any
send_all >/dev/null 2>&1
finish

start generated candump "$interface"
cangen "$interface" -n 20 -g 0 -I i -L i -D i
echo "cangen $?" >generated-code
finish

start played candump "$interface"
for number in 1 2 3 4 5; do echo "(1700000000.00${number}000) can7 5A5#0$number"; done | canplayer "$interface=can7"
echo "canplayer $?" >played-code
finish

candump -T 200 "$interface" >silence 2>&1
echo "code $?" >>silence

for wrong in none0 toolongtobeaninterface; do
    cansend $wrong 123#00
    echo "cansend $? $wrong"
    candump -T 100 $wrong
    echo "candump $? $wrong"
done >wrong 2>&1

cansend "$interface" 123##100 >flexible 2>&1
echo "code $?" >>flexible

# By rtnetlink: one interface by its name, and all that are up.
ip -json link show "$interface" | sed 's/"ifindex":[0-9]*,//' >link
ip -json link list up | grep -o "\"ifname\":\"$interface\"[^}]*\"link_type\":\"[a-z]*\"" >links
ip link show none0 >>links 2>&1
echo "code $?" >>links
