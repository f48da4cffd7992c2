#!/bin/sh
# What programs of C, Go and Python print: programs.sh INTERFACE FOLDER, where can-utils.sh runs too. The programs are those of
# payload.sh, beside this script. Each case is a file in FOLDER.
#
# Left out, since time makes them: the times of cansniffer, and how many frames a second canbusload counts; it is asked for the bits
# of a frame.

export LC_ALL=C
interface=$1
folder=$2
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$folder"
cd "$folder" || exit 2

# until_waiting PROCESS: until it sleeps with a socket of its own, as these programs do once it is bound, and not for an answer
# of `bench can`.
until_waiting() {
    # shellcheck disable=SC2010 # names of sockets, not of files
    until ls -l "/proc/$1/fd" | grep -q socket: && grep -q ') S ' "/proc/$1/stat" && ! grep -q seccomp "/proc/$1/wchan"; do
        sleep 0.05
    done
}

# Two identifiers, as long as they are sent.
cangen "$interface" -I 5A5 -L 8 -D 1122334455667788 -g 5 &
generators=$!
cangen "$interface" -I 12345678 -e -L 2 -D 0102 -g 10 &
generators="$generators $!"
timeout -s INT 2 cansniffer "$interface" -t 0 </dev/null >sniffer.raw
# Of each screen the identifiers, without the time between frames. Until the first extended frame comes, 5A5 stands without
# dashes before it: whether a screen falls into that time is chance.
seen() { sed -n -e '/ | 5A5 | /d' -e 's/^[0-9]* | /time | /p' sniffer.raw | sort -u; }
seen >sniffer
timeout -s INT 2 cansniffer "$interface" -t 0 -B </dev/null >sniffer.raw
seen >sniffer-bits
# shellcheck disable=SC2086 # a list
kill $generators
# shellcheck disable=SC2086
wait $generators
rm sniffer.raw

# Bits of a frame, all and of its data; whether the load in percent is that of the bits; and a bus without frames.
for way in -i '' -e '-e 0000000000000000'; do
    # shellcheck disable=SC2086 # an option, or none, and data
    set -- $way
    cangen "$interface" -I 5A5 -L 8 -D "${2:-1122334455667788}" -g 5 &
    generator=$!
    # shellcheck disable=SC2086 # an option, or none
    timeout -s INT 2 canbusload "$interface@500000" $1 >load.raw
    kill $generator
    wait $generator
    awk -v way="$way" '$2 > 0 {
        right = $5 == int($3 * 100 / 500000) "%" ? "as the bits" : $5 " of " $3 " bits"
        print $1, way, $3 / $2, "bits a frame,", $4 / $2, "of data, load", right
    }' load.raw | sort -u >>load
done
timeout -s INT 2 canbusload "$interface@500000" | sed '/^$/d' | sort -u >>load
rm load.raw

"$here/python3" -u "$here/socketcan_guest.py" "$interface" >python 2>&1
echo "code $?" >>python

# A program of Go answers twenty frames; what it says, and its answers.
"$here/listen-and-answer" "$interface" 20 >go &
answers=$!
candump -n 20 "$interface,3B1:7FF" >go.raw &
listener=$!
until_waiting $listener
until grep -q bound go; do sleep 0.05; done
for number in 0 1 2 3 4 5 6 7 8 9; do
    cansend "$interface" "3B0#0$number"
    cansend "$interface" "3B0#1$number"
done
wait $answers
echo "code $?" >>go
wait $listener
cat go.raw >>go
rm go.raw

# The rig for the firmware, as a log: sensors each cycle, a tick each ten, which tells of simulated time, so that the firmware needs
# no clock. The console stops it, the rig says so, it is started again, and its sensors fall silent for 80 cycles.
rig_frames() {
    awk '
        function frame(text) { printf "(%d.%06d) rig %s\n", stamp / 1000, stamp % 1000 * 1000, text; stamp++ }
        function tick(cycle) { frame(sprintf("130#%02X%02X0000000002", cycle % 256, cycle / 256)) }
        function sensors(cycle, counts) {
            frame(sprintf("120#%02X%02X0000000000%02X", counts % 256, counts / 256, cycle % 16 * 16))
        }
        BEGIN {
            for (cycle = 1; cycle <= 300; cycle++) {
                if (cycle % 10 == 1) tick(cycle)
                if (cycle <= 200 || cycle > 280) sensors(cycle, 19000 - 7 * cycle)
                if (cycle == 100) frame("108#0100")
                if (cycle == 101) frame("140#00800000")
                if (cycle == 140) frame("140#00000000")
                if (cycle == 150) frame("109#0001")
                if (cycle == 151) frame("160#0100")
            }
        }'
}

# Its frames, in their order.
"$here/firmware-socketcan" "$interface" 2>firmware.said &
firmware=$!
candump -L "$interface,110:7FF,150:7FE,10A:7FF" >firmware.raw &
listener=$!
until_waiting $firmware
until_waiting $listener
rig_frames | canplayer "$interface=rig" >/dev/null
# The last sensors of all are answered.
until [ "$(grep -c ' 110#' firmware.raw)" = 220 ]; do sleep 0.05; done
kill $firmware $listener
wait $firmware
echo "code $?" >>firmware.said
wait $listener
{ sed 's/^([0-9.]*) //' firmware.raw && cat firmware.said; } >firmware
rm firmware.raw firmware.said
