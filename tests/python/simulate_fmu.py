"""Validates an FMU with FMPy and simulates it: inputs from a CSV, outputs of all millisecond steps into a CSV.

    simulate_fmu.py FMU INPUTS.csv OUTPUTS.csv [NAME=VALUE …]

INPUTS.csv has a column time and one for each input; values hold until the next row. NAME=VALUE are start values. Numbers are written
with all their digits.
"""

import contextlib
import sys

import numpy
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu


def main():
    fmu, inputs, outputs = sys.argv[1:4]
    starts = dict(pair.split("=", 1) for pair in sys.argv[4:])
    problems = validate_fmu(fmu)
    if problems:
        sys.exit("\n".join(problems))
    described = read_model_description(fmu, validate=True)
    booleans = {variable.name for variable in described.modelVariables if variable.type == "Boolean"}
    with open(inputs) as file:
        names = file.readline().strip().split(",")
    kinds = [(name, numpy.bool_ if name in booleans else numpy.double) for name in names]
    table = numpy.loadtxt(inputs, delimiter=",", skiprows=1, ndmin=2)
    signals = numpy.array([tuple(row) for row in table], dtype=kinds)
    wanted = [variable.name for variable in described.modelVariables if variable.causality == "output"]
    log = []
    # FMPy says there which inputs have no column.
    with contextlib.redirect_stdout(sys.stderr):
        result = simulate_fmu(
            fmu,
            start_time=0.0,
            stop_time=float(table[-1, 0]) + 1e-3,
            output_interval=1e-3,
            start_values=starts,
            input=signals,
            output=wanted,
            validate=True,
            logger=lambda *arguments: log.append(str(arguments[-1])),
        )
    numpy.savetxt(outputs, numpy.array(result.tolist()), delimiter=",", fmt="%.17g", comments="", header=",".join(result.dtype.names))
    print("\n".join(log))


if __name__ == "__main__":
    main()
