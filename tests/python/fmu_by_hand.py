"""An FMU call by call with FMPy's own wrapper: reset, states, refusals. Prints JSON.

    fmu_by_hand.py FMU
"""

import json
import shutil
import sys

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi1 import FMICallException


def main():
    path = sys.argv[1]
    described = read_model_description(path)
    references = {variable.name: variable.valueReference for variable in described.modelVariables}
    folder = extract(path)
    log = []
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(lambda _environment, _name, status, category, message: log.append(message.decode()))
    callbacks.componentEnvironment = None
    identifier = described.coSimulation.modelIdentifier

    def instance(guid=described.guid):
        fmu = FMU2Slave(guid=guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName="plant")
        fmu.instantiate(callbacks=callbacks)
        return fmu

    def start(fmu):
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        fmu.setReal([references["drive_valve"]], [0.5])

    def run(fmu, begin, cycles):
        for cycle in range(begin, begin + cycles):
            fmu.doStep(currentCommunicationPoint=cycle * 1e-3, communicationStepSize=1e-3)
        names = ["drive_position_m", "drive_force_measured_N", "load_pressure_a_Pa"]
        return fmu.getReal([references[name] for name in names])

    def refused(call):
        before = len(log)
        try:
            call()
        except (FMICallException, Exception) as error:
            return {"error": str(error), "log": log[before:]}
        return {"error": None, "log": log[before:]}

    fmu = instance()
    start(fmu)
    first = run(fmu, 0, 50)
    state = fmu.getFMUState()
    on = run(fmu, 50, 50)
    fmu.setFMUState(state)
    again = run(fmu, 50, 50)
    fmu.freeFMUState(state)
    fmu.reset()
    start(fmu)
    anew = run(fmu, 0, 50)
    result = {
        "first": first,
        "anew": anew,
        "on": on,
        "again": again,
        "half_step": refused(lambda: fmu.doStep(currentCommunicationPoint=0.05, communicationStepSize=0.0005)),
        "beyond": refused(lambda: fmu.setReal([references["drive_valve"]], [1.5])),
        "fixed": refused(lambda: fmu.setReal([references["supply.pressure_bar"]], [6.0])),
        "after": run(fmu, 50, 50),
        "other_guid": refused(lambda: instance("{other}")),
    }
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(folder)
    json.dump(result, sys.stdout)


if __name__ == "__main__":
    main()
