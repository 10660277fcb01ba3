#include "device.h"

#include "otolith_protocol.h"

#define FIRMWARE_VERSION 0x0100 /* 1.0 */

#define RAD_PER_DEG 0.017453292519943295
#define STANDARD_GRAVITY 9.80665

/* Bytes of a SAMPLE16 on the line, and what one byte takes there. */
#define SAMPLE_BYTES (OTOLITH_SAMPLE16_SIZE + 6)
#define BYTE_US (1000000UL / UART_BYTES_PER_SECOND)

/* 14 % of the line are left for STATUS, HELLO and answers. A faster line is not filled: the sensor has a new value every
 * millisecond. */
#define LINE_RATE_HZ (UART_BYTES_PER_SECOND * 86 / 100 / SAMPLE_BYTES)
#define HIGHEST_RATE_HZ (LINE_RATE_HZ < 1000 ? LINE_RATE_HZ : 1000)
/* The period has 16 bits. */
#define LOWEST_RATE_HZ (CLOCK_TICKS_PER_SECOND / 65535 + 1)

#if RATE_HZ < LOWEST_RATE_HZ || RATE_HZ > HIGHEST_RATE_HZ
#error "RATE_HZ does not fit BAUD: at 115200 take 31 to 459"
#endif

static uint8_t frame[OTOLITH_MAX_FRAME];
static uint8_t seq;
static bool measures = true;
static uint16_t period = CLOCK_TICKS_PER_SECOND / RATE_HZ;

static uint32_t flags;
static int16_t temperature_centi_deg;
static uint16_t samples_not_sent;
static uint16_t tx_overrun;

/* The rate that the whole number of timer ticks really gives. */
static uint32_t rate_in_force_mhz(void)
{
    return (uint32_t)(CLOCK_TICKS_PER_SECOND * 1000ULL / period);
}

uint16_t device_first_period(void)
{
    return period;
}

bool device_measures(void)
{
    return measures;
}

/* Queues the frame. One that does not fit uses up no sequence number: it is counted in STATUS instead. */
static bool send(size_t length)
{
    if (!uart_send(frame, length)) {
        tx_overrun++;
        return false;
    }
    seq++;
    return true;
}

void device_send_hello(void)
{
    const struct otolith_hello hello = {
        .device_id = DEVICE_ID,
        .firmware = FIRMWARE_VERSION,
        .rate_mhz = rate_in_force_mhz(),
        .gyro_scale = (float)(GYRO_RANGE_DPS * RAD_PER_DEG / 32768.0),
        .accel_scale = (float)(ACCEL_RANGE_G * STANDARD_GRAVITY / 32768.0),
        .gyro_range_dps = GYRO_RANGE_DPS,
        .accel_range_g = ACCEL_RANGE_G,
        .caps = 0,
        .name = sensor_name,
    };
    send(otolith_hello(frame, seq, &hello));
}

/* The clip flags tell of the time since the last STATUS. */
void device_send_status(void)
{
    const struct otolith_status status = {
        .t_us = clock_us(clock_now()),
        .temperature_centi_deg = temperature_centi_deg,
        .flags = flags,
        .dropped = clock_missed_ticks() + samples_not_sent,
        .tx_overrun = tx_overrun,
        .sensor_err = sensor_errors(),
    };
    if (send(otolith_status(frame, seq, &status)))
        flags = 0;
}

void device_send_text(const char *line)
{
    send(otolith_text(frame, seq, line));
}

static bool clipped(const int16_t counts[3])
{
    for (uint8_t axis = 0; axis < 3; axis++) {
        if (counts[axis] == INT16_MIN || counts[axis] == INT16_MAX)
            return true;
    }
    return false;
}

void device_send_sample(struct instant due, const struct reading *reading)
{
    if (clipped(reading->gyro))
        flags |= OTOLITH_FLAG_GYRO_CLIP;
    if (clipped(reading->accel))
        flags |= OTOLITH_FLAG_ACCEL_CLIP;
    temperature_centi_deg = reading->temperature_centi_deg;
    if (!send(otolith_sample16(frame, seq, (uint32_t)clock_us(due), reading->gyro, reading->accel)))
        samples_not_sent++;
}

static void acknowledge(const struct otolith_cmd *cmd, uint8_t result, uint32_t value)
{
    send(otolith_ack(frame, seq, cmd, result, value));
}

/* A HELLO follows a new rate at once: it announces the rate. */
static void set_rate(const struct otolith_cmd *cmd)
{
    if (cmd->arg < LOWEST_RATE_HZ * 1000UL || cmd->arg > HIGHEST_RATE_HZ * 1000UL) {
        acknowledge(cmd, OTOLITH_ACK_OUT_OF_RANGE, rate_in_force_mhz());
        return;
    }
    period = (uint16_t)((CLOCK_TICKS_PER_SECOND * 1000ULL + cmd->arg / 2) / cmd->arg);
    clock_set_period(period);
    acknowledge(cmd, OTOLITH_ACK_OK, rate_in_force_mhz());
    device_send_hello();
}

static void obey(const struct otolith_cmd *cmd)
{
    switch (cmd->code) {
    case OTOLITH_CMD_START:
    case OTOLITH_CMD_STOP:
        measures = cmd->code == OTOLITH_CMD_START;
        acknowledge(cmd, OTOLITH_ACK_OK, 0);
        break;
    case OTOLITH_CMD_SET_RATE:
        set_rate(cmd);
        break;
    case OTOLITH_CMD_SEND_HELLO:
        acknowledge(cmd, OTOLITH_ACK_OK, 0);
        device_send_hello();
        break;
    default: /* ranges are fixed; there is nothing to save and no self-test */
        acknowledge(cmd, OTOLITH_ACK_UNKNOWN_CODE, 0);
        break;
    }
}

/* The answer begins to leave when what is queued before it has left. */
static void exchange_clocks(uint64_t t1_us, struct instant received)
{
    uint64_t t3_us = clock_us(clock_now()) + uart_backlog() * BYTE_US;
    send(otolith_sync(frame, seq, t1_us, clock_us(received), t3_us));
}

void device_answer(struct uart_frame *request)
{
    int length = otolith_open_frame(request->bytes, request->length);
    const uint8_t *payload = request->bytes + OTOLITH_PAYLOAD_AT;
    uint8_t type = request->bytes[OTOLITH_TYPE_AT];
    if (type == OTOLITH_SYNC && length == OTOLITH_SYNC_SIZE) {
        exchange_clocks(otolith_u64_at(payload), request->received);
    } else if (type == OTOLITH_CMD && length == OTOLITH_CMD_SIZE) {
        struct otolith_cmd cmd = otolith_cmd_at(payload);
        obey(&cmd);
    }
}
