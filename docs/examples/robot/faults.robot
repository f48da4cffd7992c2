*** Settings ***
Documentation       What breaks is noticed, an emergency stop stops, and there is a way back.
Library             airbench_hil.robot.Airbench


*** Test Cases ***
A Sensor That Is Off Moves The Carriage By As Much
    [Tags]    REQ-FLT-1
    ${mine} =    Python Controller    ${CURDIR}/controller.py
    Start Rig    controllers=${mine}    carriage_position_m=0.15
    Run For    3 s
    Fault    position-sensor-offset    drive    offset_m=0.01
    Expect    DriveSensors.position > 0.305    within=5 ms
    Stable For    near(DriveSensors.position, 0.3, 0.003)    0.5 s    within=3 s
    Mend    all
    Expect    DriveSensors.position < 0.295    within=5 ms

The Drive Misses A Partner That Was Killed
    [Tags]    REQ-STP-1
    ${own} =    Own Controller    two=True
    Start Rig    load-step    ${own}
    Wait For    DriveChainStatus.main_chain == "experiment"
    Kill Program    controller-load
    Expect    DriveEmergencyStop.reason == "partner-lost"    within=200 ms
    Expect    RigStatus.emergency_stop == 1    within=20 ms

After An Emergency Stop The Operator Starts Again
    [Tags]    REQ-STP-2
    ${own} =    Own Controller    after_emergency_stop=on-start
    Start Rig    step    ${own}
    Wait For    DriveChainStatus.main_chain == "experiment"
    Emergency Stop
    Expect    RigStatus.emergency_stop == 1    within=20 ms
    Never    RigStatus.emergency_stop == 0    during=0.5 s
    Release Emergency Stop
    Expect    DriveChainStatus.emergency_stop_chain == "waiting-for-start"    within=2 s
    Start Experiment
    Expect    DriveChainStatus.main_chain == "experiment"    within=3 s
    Finish Run

A Valve That Sticks As Planned Is In The Record
    [Tags]    REQ-FLT-2
    ${own} =    Own Controller
    ${stuck} =    Planned Fault    valve-stuck    drive    from_s=2.0    for_s=0.3
    Start Rig    step    ${own}    faults=${stuck}    seconds=3
    Finish Run
    ${folder} =    Run Folder
    ${faults} =    Evaluate    pathlib.Path($folder, "faults.csv").read_text()    modules=pathlib
    Should Contain    ${faults}    valve-stuck
