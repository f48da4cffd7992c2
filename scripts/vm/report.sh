# shellcheck shell=bash
# shellcheck disable=SC2154 # names shared with vcan-vm, which sources this
# Latency reports of the runs that came back; sourced by vcan-vm.
#
# Made here rather than in the guest, which is slow. They show the way from the loop to the page on this kernel and this
# bus; being of an emulated machine, they say themselves that they support no latency claim.
#
# Expects $root, $out, $kernel, $kernel_version, $shipped_bench and say.

# Of each run/latency/BUS/ that the job left: target/vm-reports/KERNEL-BUS with report.html, report.json, report.md and
# what the guest was. A report that cannot be made is told and fails nothing: the runs are the result, and they are there.
make_reports() {
    local bus folder
    for bus in "$out"/run/latency/*/; do
        [[ -d $bus ]] || continue
        folder=$root/target/vm-reports/$kernel-$(basename "$bus")
        rm -rf "$folder"
        mkdir -p "$folder"
        cp "$out/guest.json" "$folder/"
        if "$shipped_bench" report "$bus" --out "$folder" --title "$(basename "$bus") in QEMU, kernel $kernel_version: function, not latency" >"$folder/bench.txt" 2>&1; then
            say "latency report in ${folder#"$root"/}"
        else
            say "no latency report: $(tail -n 1 "$folder/bench.txt")"
        fi
    done
}
