*** Settings ***
Documentation       airbench's own controller reaches its places, and a controller of one's own does.
Library             airbench_hil.robot.Airbench


*** Test Cases ***
The Drive Reaches Its Place In Time
    [Tags]    REQ-POS-1
    ${own} =    Own Controller    position-p
    Start Rig    point-to-point    ${own}
    Expect    DriveSensors.position > 0.39    within=4 s
    Finish Run
    Run Should Have Passed
    Figure Should Be At Most    position_error_dynamic_m    0.004

A Higher Gain Rises Faster
    [Tags]    REQ-POS-2
    ${slow} =    Rise Time With Gain    3
    ${fast} =    Rise Time With Gain    25
    Should Be True    ${fast} < 0.8 * ${slow}

A Function Of Python Holds The Carriage
    [Tags]    REQ-POS-3
    ${mine} =    Python Controller    ${CURDIR}/controller.py
    Start Rig    controllers=${mine}    carriage_position_m=0.15
    Stable For    near(DriveSensors.position, 0.3, 0.002)    0.5 s    within=3 s
    ${opening} =    Read Signal    DriveValveCommand.opening
    Should Be True    abs(${opening}) < 0.05


*** Keywords ***
Rise Time With Gain
    [Arguments]    ${gain_per_s}
    ${own} =    Own Controller    position-p    drive.algorithm.gain_per_s=${gain_per_s}
    Start Rig    step    ${own}
    Finish Run
    ${rise_s} =    Figure    position_rise_s
    RETURN    ${rise_s}
