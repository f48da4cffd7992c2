/* The drive controller.
 *
 *                sensors, tick        there            2 s            twice 3, 1, 3, 1 s
 *     WAITING ─────────────► APPROACH ─────► SETTLING ─────► EXPERIMENT ─────► FINAL ─────► DONE
 *        ▲                       └───────────────┴───────┬───────┴────────────────┘ 0.5 s
 *        │ RunControl start, no stop any more            │ emergency stop, abort; own sensors silent for 50 ms
 *        └──────────────────────────────────── ABORTED ◄─┴─► FAULT (trips the emergency stop)
 *
 * Each sensor frame is answered at once, with the valve shut in all states but the four in the middle; who runs on the rig's
 * sensors needs no clock in step with it. The set-point is a function of the rig's cycle number, so that cycles that the
 * rig skipped do not shift it.
 */
#include "firmware.h"

#include "motion.h"
#include "rig.h"

#include <string.h>

#define START_M 0.1F
#define FAR_M 0.4F
#define APPROACH_MS 1000U
#define MOVE_MS 3000U
#define REST_MS 1000U
#define REPETITION_MS (2U * (MOVE_MS + REST_MS))
#define REPETITIONS 2U
#define SETTLING_MS 2000U
#define FINAL_MS 500U
#define STATUS_EVERY_CYCLES 10U
#ifndef SENSORS_LOST_MS
#define SENSORS_LOST_MS 50U
#endif
#define REPEAT_STOP_MS 100U
#define REASON_SENSOR_LOSS 3U
#define OUTBOX_FRAMES 8U

/* States by the numbers that rig.dbc gives them. */
enum state {
    WAITING = 0,
    APPROACH = 1,
    SETTLING = 4,
    EXPERIMENT = 5,
    FINAL = 6,
    DONE = 7,
    ABORTED = 8,
    FAULT = 9
};

static struct {
    enum state state;
    uint32_t since_cycle; /* in which the state was entered */
    float from_m;         /* where the approach began */
    float position_m;
    struct motion_control control;
    struct motion_point set_point;

    uint32_t cycle; /* of the newest sensors, by the tick and the counters since */
    bool cycle_known;
    bool answer_waits; /* sensors came before the first tick */
    bool own_time;     /* the board's milliseconds are the rig's, even where that simulates time */
    bool lockstep;     /* the rig simulates time: for who has no such clock it passes with the rig's ticks */
    bool stopped;      /* the rig's emergency stop */
    bool tell_status;
    uint32_t silent_ms;
    uint32_t stop_repeat_ms;
    uint8_t alive;

    struct port_frame outbox[OUTBOX_FRAMES];
    uint32_t out_first;
    uint32_t out_count;
} fw;

static void enter(enum state state)
{
    fw.state = state;
    fw.since_cycle = fw.cycle;
    fw.tell_status = true;
}

static bool moves_the_valve(void)
{
    return fw.state == APPROACH || fw.state == SETTLING || fw.state == EXPERIMENT || fw.state == FINAL;
}

/* A place in the outbox; the oldest frame is given up when it is full: what is old is worth least. */
static struct port_frame *post(uint32_t id, uint8_t length)
{
    if (fw.out_count == OUTBOX_FRAMES) {
        fw.out_first = (fw.out_first + 1U) % OUTBOX_FRAMES;
        fw.out_count--;
    }
    struct port_frame *frame = &fw.outbox[(fw.out_first + fw.out_count) % OUTBOX_FRAMES];
    fw.out_count++;
    memset(frame, 0, sizeof *frame);
    frame->id = id;
    frame->length = length;
    return frame;
}

bool firmware_transmit(struct port_frame *frame)
{
    if (fw.out_count == 0U) {
        return false;
    }
    *frame = fw.outbox[fw.out_first];
    fw.out_first = (fw.out_first + 1U) % OUTBOX_FRAMES;
    fw.out_count--;
    return true;
}

/* CRC-8 SAE J1850, four bits at a time: entry i is what i << 4 leaves of the polynomial 0x1D. */
static uint8_t crc8(uint8_t crc, uint8_t byte)
{
    static const uint8_t LEFT[16] = {0x00, 0x1D, 0x3A, 0x27, 0x74, 0x69, 0x4E, 0x53,
                                     0xE8, 0xF5, 0xD2, 0xCF, 0x9C, 0x81, 0xA6, 0xBB};
    crc ^= byte;
    crc = (uint8_t)((crc << 4) ^ LEFT[crc >> 4]);
    return (uint8_t)((crc << 4) ^ LEFT[crc >> 4]);
}

static void send_command(float opening)
{
    struct rig_drive_valve_command_t command;
    rig_drive_valve_command_init(&command);
    command.opening = rig_drive_valve_command_opening_encode(opening);
    command.enable = moves_the_valve() ? 1U : 0U;
    command.alive = fw.alive;
    command.echo = (uint16_t)(fw.cycle & 0xFFFU);
    fw.alive = (uint8_t)((fw.alive + 1U) & 0xFU);

    struct port_frame *frame = post(RIG_DRIVE_VALVE_COMMAND_FRAME_ID, RIG_DRIVE_VALVE_COMMAND_LENGTH);
    rig_drive_valve_command_pack(frame->data, &command, sizeof frame->data);
    uint8_t crc = crc8(crc8(0xFFU, (uint8_t)(frame->id & 0xFFU)), (uint8_t)(frame->id >> 8));
    for (uint32_t i = 0; i + 1U < RIG_DRIVE_VALVE_COMMAND_LENGTH; i++) {
        crc = crc8(crc, frame->data[i]);
    }
    frame->data[RIG_DRIVE_VALVE_COMMAND_LENGTH - 1U] = (uint8_t)(crc ^ 0xFFU);
}

static void send_status(void)
{
    struct rig_drive_chain_status_t status;
    rig_drive_chain_status_init(&status);
    status.main_chain = (uint8_t)fw.state;
    status.emergency_stop_chain = fw.stopped || fw.state == FAULT ? 1U : 0U;
    status.ok = (uint8_t)(fw.state != FAULT && !fw.stopped);
    status.experiment = 8U;
    struct port_frame *frame = post(RIG_DRIVE_CHAIN_STATUS_FRAME_ID, RIG_DRIVE_CHAIN_STATUS_LENGTH);
    rig_drive_chain_status_pack(frame->data, &status, sizeof frame->data);

    struct rig_drive_chain_values_t values;
    rig_drive_chain_values_init(&values);
    values.averaged_position = rig_drive_chain_values_averaged_position_encode(fw.position_m);
    values.position_set_point = rig_drive_chain_values_position_set_point_encode(fw.set_point.position_m);
    values.control_error = rig_drive_chain_values_control_error_encode(fw.set_point.position_m - fw.position_m);
    frame = post(RIG_DRIVE_CHAIN_VALUES_FRAME_ID, RIG_DRIVE_CHAIN_VALUES_LENGTH);
    rig_drive_chain_values_pack(frame->data, &values, sizeof frame->data);
    fw.tell_status = false;
}

static void send_emergency_stop(uint8_t reason, uint8_t release)
{
    const struct rig_drive_emergency_stop_t stop = {.reason = reason, .release = release};
    struct port_frame *frame = post(RIG_DRIVE_EMERGENCY_STOP_FRAME_ID, RIG_DRIVE_EMERGENCY_STOP_LENGTH);
    rig_drive_emergency_stop_pack(frame->data, &stop, sizeof frame->data);
    fw.stop_repeat_ms = REPEAT_STOP_MS;
}

/* The set-point in this cycle, and the next state when this one is over. */
static void advance(void)
{
    const uint32_t now = fw.cycle - fw.since_cycle;
    switch (fw.state) {
    case WAITING:
        fw.set_point = (struct motion_point){.position_m = fw.position_m};
        if (!fw.stopped) {
            fw.from_m = fw.position_m;
            enter(APPROACH);
        }
        break;
    case APPROACH:
        fw.set_point = motion_bestehorn(fw.from_m, START_M, now, APPROACH_MS);
        if (now >= APPROACH_MS) {
            enter(SETTLING);
        }
        break;
    case SETTLING:
        fw.set_point = (struct motion_point){.position_m = START_M};
        if (now >= SETTLING_MS) {
            enter(EXPERIMENT);
        }
        break;
    case EXPERIMENT: {
        const uint32_t within = now % REPETITION_MS;
        if (now >= REPETITIONS * REPETITION_MS) {
            fw.set_point = (struct motion_point){.position_m = START_M};
        } else if (within < MOVE_MS + REST_MS) {
            fw.set_point = motion_bestehorn(START_M, FAR_M, within, MOVE_MS);
        } else {
            fw.set_point = motion_bestehorn(FAR_M, START_M, within - MOVE_MS - REST_MS, MOVE_MS);
        }
        if (now >= REPETITIONS * REPETITION_MS) {
            enter(FINAL);
        }
        break;
    }
    case FINAL:
        if (now >= FINAL_MS) {
            enter(DONE);
        }
        break;
    case DONE:
    case ABORTED:
    case FAULT:
        break;
    }
}

static void answer(void)
{
    advance();
    const float opening = motion_step(&fw.control, fw.set_point, fw.position_m);
    const bool status_is_due = fw.tell_status || fw.cycle % STATUS_EVERY_CYCLES == 0U;
    /* The rig waits for the command, so it goes first. Who takes part in lockstep by its echo sends it last: there it says that
     * this cycle is answered, and what follows belongs to the next one. */
    if (status_is_due && !fw.own_time) {
        send_status();
    }
    send_command(moves_the_valve() ? opening : 0.0F);
    if (status_is_due && fw.own_time) {
        send_status();
    }
}

static void take_sensors(const struct port_frame *frame)
{
    struct rig_drive_sensors_t sensors;
    if (rig_drive_sensors_unpack(&sensors, frame->data, frame->length) != 0) {
        return;
    }
    fw.position_m = rig_drive_sensors_position_decode(sensors.position);
    fw.silent_ms = 0U;
    if (!fw.cycle_known) {
        fw.answer_waits = true;
        return;
    }
    fw.cycle += (sensors.alive - fw.cycle) & 0xFU;
    answer();
}

static void lose_time(uint32_t milliseconds)
{
    fw.silent_ms += milliseconds;
    if (moves_the_valve() && fw.silent_ms >= SENSORS_LOST_MS) {
        enter(FAULT);
        send_emergency_stop(REASON_SENSOR_LOSS, 0U);
        send_status();
        return;
    }
    if (fw.state == FAULT) {
        fw.stop_repeat_ms -= fw.stop_repeat_ms < milliseconds ? fw.stop_repeat_ms : milliseconds;
        if (fw.stop_repeat_ms == 0U) {
            send_emergency_stop(REASON_SENSOR_LOSS, 0U);
        }
    }
}

static void take_tick(const struct port_frame *frame)
{
    struct rig_tick_t tick;
    if (rig_tick_unpack(&tick, frame->data, frame->length) != 0) {
        return;
    }
    const uint32_t since_ms = fw.cycle_known ? tick.cycle - fw.cycle : 0U;
    fw.lockstep = tick.lockstep != 0U && !fw.own_time;
    fw.cycle = tick.cycle;
    fw.cycle_known = true;
    if (fw.answer_waits) {
        fw.answer_waits = false;
        answer();
    } else if (fw.lockstep && since_ms < 1000U) {
        lose_time(since_ms);
    }
}

static void stop(void)
{
    fw.stopped = true;
    if (moves_the_valve()) {
        enter(ABORTED);
    }
}

static void take_rig_status(const struct port_frame *frame)
{
    struct rig_rig_status_t status;
    if (rig_rig_status_unpack(&status, frame->data, frame->length) == 0) {
        fw.stopped = status.emergency_stop != 0U;
        if (fw.stopped) {
            stop();
        }
    }
}

static void take_emergency_stop(const struct port_frame *frame)
{
    struct rig_console_emergency_stop_t told; /* all four have the same form */
    if (rig_console_emergency_stop_unpack(&told, frame->data, frame->length) != 0) {
        return;
    }
    if (told.release == 0U) {
        stop();
    } else if (frame->id == RIG_CONSOLE_EMERGENCY_STOP_FRAME_ID && fw.state == FAULT && fw.silent_ms < SENSORS_LOST_MS) {
        send_emergency_stop(0U, 1U);
        enter(ABORTED);
    }
}

static void take_run_control(const struct port_frame *frame)
{
    struct rig_run_control_t control;
    if (rig_run_control_unpack(&control, frame->data, frame->length) != 0) {
        return;
    }
    if (control.command == 2U && moves_the_valve()) {
        enter(ABORTED);
    } else if (control.command == 1U && fw.state == ABORTED && !fw.stopped) {
        enter(WAITING);
    }
}

void firmware_init(bool own_time)
{
    memset(&fw, 0, sizeof fw);
    fw.own_time = own_time;
}

void firmware_receive(const struct port_frame *frame)
{
    switch (frame->id) {
    case RIG_DRIVE_SENSORS_FRAME_ID:
        take_sensors(frame);
        break;
    case RIG_TICK_FRAME_ID:
        take_tick(frame);
        break;
    case RIG_RIG_STATUS_FRAME_ID:
        take_rig_status(frame);
        break;
    case RIG_CONSOLE_EMERGENCY_STOP_FRAME_ID:
    case RIG_RIG_EMERGENCY_STOP_FRAME_ID:
    case RIG_LOAD_EMERGENCY_STOP_FRAME_ID:
        take_emergency_stop(frame);
        break;
    case RIG_RUN_CONTROL_FRAME_ID:
        take_run_control(frame);
        break;
    default:
        break;
    }
}

void firmware_millisecond(void)
{
    if (!fw.lockstep) {
        lose_time(1U);
    }
}
