#!/bin/sh
# What isotpsend and isotprecv of can-utils print and how they end, and the frames between them: isotp.sh INTERFACE FOLDER, where
# can-utils.sh runs too. Each case is a file in FOLDER.

interface=$1
folder=$2
mkdir -p "$folder"
cd "$folder" || exit 2

# case_of NAME BYTES RECEIVER-OPTIONS SENDER-OPTIONS: a message that counts up, the receiver's print of it, and the frames. It is sent
# again until the receiver, which says nothing when it is ready, has had it.
case_of() {
    name=$1 bytes=$2
    : >"$name.received"
    # shellcheck disable=SC2086 # options
    { isotprecv -s 321 -d 123 $3 "$interface" >"$name.print" && mv "$name.print" "$name.received"; } &
    receiver=$!
    candump "$interface,123:7FF,321:7FF,7E0:7F0" >"$name.raw" &
    listener=$!
    until [ -s "$name.raw" ]; do
        cansend "$interface" 7E0#
        sleep 0.1
    done
    until [ -s "$name.received" ]; do
        cansend "$interface" 7E0#
        # shellcheck disable=SC2086
        isotpsend -s 123 -d 321 -D "$bytes" $4 "$interface" 2>"$name.code"
        echo "code $?" >>"$name.code"
        cansend "$interface" 7E1#
        sleep 0.3
    done
    wait $receiver
    until [ "$(tail -n 1 "$name.raw" | grep -c '  7E1 ')" = 1 ]; do sleep 0.1; done
    kill $listener
    wait $listener
    # The last attempt alone.
    awk '/  7E0 / { count = 0; next } /  7E1 / { next } { lines[count++] = $0 } END { for (n = 0; n < count; n++) print lines[n] }' \
        "$name.raw" >"$name"
    cat "$name.received" "$name.code" >>"$name"
    rm "$name.raw" "$name.received" "$name.code"
}

case_of single 5 "" ""
case_of several 50 "" ""
case_of blocks 50 "-b 3 -m 5" "-b"
case_of extended 30 "-x 55:AA" "-x AA:55"
case_of padded 10 "-p CC:DD -P a" "-p DD:CC -P a"

# Nobody answers: who waits for the end is told, and who does not is not.
isotpsend -s 123 -d 321 -D 20 -b "$interface" >nobody 2>&1
echo "code $?" >>nobody
isotpsend -s 123 -d 321 -D 20 "$interface" >>nobody 2>&1
echo "code $?" >>nobody
isotpsend -s 123 -d 123 -D 20 "$interface" >>nobody 2>&1
echo "code $?" >>nobody
isotpsend -s 123 -d 321 -D 20 -L 72:64:0 "$interface" >>nobody 2>&1
echo "code $?" >>nobody
