#!/bin/sh
# What emulator and controller say on an interface, apart and as 'airbench run', which scripts/run becomes, and which frames they send:
# own-programs.sh INTERFACE FOLDER, where can-utils.sh runs too. RIG and EXPERIMENT are their files, AIRBENCH_SHARE has those of a run.
#
# Left out, since time makes them: every number but exit codes and lengths of frames, what is said of late cycles, of waiting
# and of missing rights, and how often and in which order a thing is said.

export LC_ALL=C
interface=$1
folder=$2
mkdir -p "$folder"
cd "$folder" || exit 2

candump -L "$interface" >own.raw &
listener=$!
# It has heard its first frame.
until [ -s own.raw ]; do
    cansend "$interface" 7E0#
    sleep 0.1
done
emulator run --bus "can://$interface" --rig "$RIG" --experiment "$EXPERIMENT" --out own.run --seconds 2.5 >own.emulator 2>&1 &
emulator=$!
controller run --bus "can://$interface" --rig "$RIG" --experiment "$EXPERIMENT" --out own.run >own.controller 2>&1
controller_code=$?
wait $emulator
echo "emulator $?, controller $controller_code" >own
# It ends before the experiment begins, in which a machine that stands still would show.
airbench run --bus "can://$interface" --out own.run --seconds 0.9 >own.airbench 2>&1
echo "airbench run $?" >>own
kill $listener
wait $listener
for program in emulator controller airbench; do
    sed -e '/warning/d' -e '/woke late/d' -e '/waiting for the rig/d' -e 's/[0-9][0-9.]* [mun]*s\>/TIME/g' -e 's/[0-9][0-9.]*/N/g' -e 's/files in .*/files/' own.$program | sort -u
done >>own
sed -e 's/^([0-9.]*) //' own.raw | awk -F '#' '!/7E0/ { print $1 "#", length($2) / 2, "bytes" }' | sort -u >>own
rm -r own.*
