"""Turns an MDF4 file into a CSV that a mapping file describes (discrepancy/docs/records.md).

    mdf4_to_csv.py FILE.mf4 OUT.csv

Every stamp of every channel makes a row; what was not sampled at it stays empty. Nothing is interpolated. Prints the columns, for the
mapping, each with its unit.
"""

import sys

from asammdf import MDF


def main():
    if len(sys.argv) != 3:
        sys.exit("usage: mdf4_to_csv.py FILE.mf4 OUT.csv")
    with MDF(sys.argv[1]) as mdf:
        table = mdf.to_dataframe(time_from_zero=True, use_interpolation=False)
        units = {name: mdf.get(name, *mdf.whereis(name)[0]).unit for name in table.columns if mdf.whereis(name)}
    table.index.name = "time_s"
    table.to_csv(sys.argv[2], float_format="%.9g")
    print(f"{len(table)} rows; column time_s in s")
    for name in table.columns:
        print(f"column {name}" + (f" in {units[name]}" if units.get(name) else ""))


if __name__ == "__main__":
    main()
