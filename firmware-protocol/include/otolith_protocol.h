/* Wire format of otolith's IMU firmware, version 1, for C99 firmware. The specification is ../README.md.
 *
 * Header only: constants, byte offsets, the few functions a device needs to send, and one to read what the host
 * sends. No heap, no libc beyond <stdint.h> and <string.h>. Bytes are written and read one by one: any alignment, any
 * byte order of the CPU. A whole device is in ../examples.
 */
#ifndef OTOLITH_PROTOCOL_H
#define OTOLITH_PROTOCOL_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#define OTOLITH_VERSION 1

/* ---------------------------------------------------------------- serial frame: COBS(type seq payload crc16) 0x00 */

#define OTOLITH_MAX_PAYLOAD 246 /* bytes */
#define OTOLITH_MAX_BODY 250    /* type, seq, payload, CRC: one COBS block */
#define OTOLITH_MAX_FRAME 252   /* body, COBS byte, delimiter */

enum otolith_type {
    OTOLITH_HELLO = 0x01,
    OTOLITH_SAMPLE16 = 0x10,
    OTOLITH_BATCH16 = 0x11,
    OTOLITH_SAMPLE_F32 = 0x12,
    OTOLITH_STATUS = 0x20,
    OTOLITH_SYNC = 0x21,
    OTOLITH_TEXT = 0x30,
    OTOLITH_CMD = 0x40,
    OTOLITH_ACK = 0x41
};

/* Payload sizes, bytes. HELLO is followed by its name, BATCH16 by its rows. */
#define OTOLITH_HELLO_SIZE 27
#define OTOLITH_SAMPLE16_SIZE 16
#define OTOLITH_BATCH16_SIZE 7
#define OTOLITH_BATCH16_ROW_SIZE 12
#define OTOLITH_BATCH16_MAX_ROWS 19
#define OTOLITH_SAMPLE_F32_SIZE 28
#define OTOLITH_STATUS_SIZE 20
#define OTOLITH_SYNC_SIZE 24
#define OTOLITH_CMD_SIZE 6
#define OTOLITH_ACK_SIZE 7

/* STATUS flags; the low 16 also travel in CAN's TIME. */
#define OTOLITH_FLAG_GYRO_CLIP 0x01u
#define OTOLITH_FLAG_ACCEL_CLIP 0x02u
#define OTOLITH_FLAG_SELF_TEST_OK 0x04u
#define OTOLITH_FLAG_FIFO_OVERRUN 0x08u
#define OTOLITH_FLAG_TIME_SYNCHRONISED 0x10u
#define OTOLITH_FLAG_CALIBRATING 0x20u

enum otolith_command {
    OTOLITH_CMD_START = 1,
    OTOLITH_CMD_STOP = 2,
    OTOLITH_CMD_SET_RATE = 3,        /* mHz */
    OTOLITH_CMD_SET_GYRO_RANGE = 4,  /* deg/s */
    OTOLITH_CMD_SET_ACCEL_RANGE = 5, /* g */
    OTOLITH_CMD_SELF_TEST = 6,
    OTOLITH_CMD_SAVE = 7,
    OTOLITH_CMD_SEND_HELLO = 8
};

enum otolith_ack_result {
    OTOLITH_ACK_OK = 0,
    OTOLITH_ACK_UNKNOWN_CODE = 1,
    OTOLITH_ACK_OUT_OF_RANGE = 2,
    OTOLITH_ACK_BUSY = 3,
    OTOLITH_ACK_FAILED = 4
};

/* ---------------------------------------------------------------- classic CAN: 11-bit id = base + 0x10 node + offset */

#define OTOLITH_CAN_BASE 0x3A0
#define OTOLITH_CAN_NODE_STRIDE 0x10
#define OTOLITH_CAN_DLC 8
#define OTOLITH_CAN_TICK_US 10
#define OTOLITH_CAN_DESC_RANGES 0   /* first byte of DESC */
#define OTOLITH_CAN_DESC_IDENTITY 1 /* first byte of DESC */

enum otolith_can_offset {
    OTOLITH_CAN_GYRO = 0,
    OTOLITH_CAN_ACCEL = 1,
    OTOLITH_CAN_TIME = 2,
    OTOLITH_CAN_HEALTH = 3,
    OTOLITH_CAN_DESC = 4,
    OTOLITH_CAN_CMD = 5,
    OTOLITH_CAN_ACK = 6
};

/* ---------------------------------------------------------------- little-endian fields; each returns the next place */

static inline uint8_t *otolith_put_u8(uint8_t *at, uint8_t value)
{
    *at = value;
    return at + 1;
}

static inline uint8_t *otolith_put_u16(uint8_t *at, uint16_t value)
{
    at[0] = (uint8_t)(value & 0xFFu);
    at[1] = (uint8_t)(value >> 8);
    return at + 2;
}

static inline uint8_t *otolith_put_u32(uint8_t *at, uint32_t value)
{
    at = otolith_put_u16(at, (uint16_t)(value & 0xFFFFu));
    return otolith_put_u16(at, (uint16_t)(value >> 16));
}

static inline uint8_t *otolith_put_u64(uint8_t *at, uint64_t value)
{
    at = otolith_put_u32(at, (uint32_t)(value & 0xFFFFFFFFu));
    return otolith_put_u32(at, (uint32_t)(value >> 32));
}

static inline uint8_t *otolith_put_f32(uint8_t *at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits); /* IEEE 754 binary32 */
    return otolith_put_u32(at, bits);
}

static inline uint8_t *otolith_put_i16x3(uint8_t *at, const int16_t xyz[3])
{
    int axis;
    for (axis = 0; axis < 3; axis++)
        at = otolith_put_u16(at, (uint16_t)xyz[axis]);
    return at;
}

/* ---------------------------------------------------------------- CRC, COBS, frame */

/* CRC-16/IBM-3740: "123456789" gives 0x29B1. Eight steps per byte, no table. */
static inline uint16_t otolith_crc16(const uint8_t *bytes, size_t length)
{
    uint16_t crc = 0xFFFFu;
    size_t i;
    int bit;
    for (i = 0; i < length; i++) {
        crc = (uint16_t)(crc ^ ((uint16_t)bytes[i] << 8));
        for (bit = 0; bit < 8; bit++)
            crc = (uint16_t)((crc & 0x8000u) ? ((unsigned)crc << 1) ^ 0x1021u : (unsigned)crc << 1);
    }
    return crc;
}

/* Encodes block[1] .. block[length - 1] in place; block[0] receives the first code. length <= 251. */
static inline void otolith_cobs_encode_in_place(uint8_t *block, size_t length)
{
    size_t code_at = 0, at;
    for (at = 1; at < length; at++) {
        if (block[at] == 0) {
            block[code_at] = (uint8_t)(at - code_at);
            code_at = at;
        }
    }
    block[code_at] = (uint8_t)(length - code_at);
}

/* Where the payload of a frame goes: fill it here, then call otolith_finish_frame. */
static inline uint8_t *otolith_payload(uint8_t frame[OTOLITH_MAX_FRAME])
{
    return frame + 3;
}

/* Completes a frame around the payload written at otolith_payload(frame); returns its length on the wire, or 0 if
 * the payload is too long. Raise seq by one for every frame of any type. */
static inline size_t otolith_finish_frame(uint8_t frame[OTOLITH_MAX_FRAME], uint8_t type, uint8_t seq,
                                          size_t payload_length)
{
    size_t crc_at = 3 + payload_length;
    if (payload_length > OTOLITH_MAX_PAYLOAD)
        return 0;
    frame[1] = type;
    frame[2] = seq;
    otolith_put_u16(frame + crc_at, otolith_crc16(frame + 1, crc_at - 1));
    otolith_cobs_encode_in_place(frame, crc_at + 2);
    frame[crc_at + 2] = 0;
    return crc_at + 3;
}

/* A whole SAMPLE16 frame; returns its length, always 22. t_us wraps; counts as HELLO's scales say. */
static inline size_t otolith_sample16(uint8_t frame[OTOLITH_MAX_FRAME], uint8_t seq, uint32_t t_us,
                                      const int16_t gyro[3], const int16_t accel[3])
{
    uint8_t *at = otolith_put_u32(otolith_payload(frame), t_us);
    at = otolith_put_i16x3(at, gyro);
    at = otolith_put_i16x3(at, accel);
    return otolith_finish_frame(frame, OTOLITH_SAMPLE16, seq, (size_t)(at - otolith_payload(frame)));
}

/* What HELLO says. */
struct otolith_hello {
    uint32_t device_id;
    uint16_t firmware;       /* major in the high byte */
    uint32_t rate_mhz;       /* millihertz */
    float gyro_scale;        /* rad/s per count */
    float accel_scale;       /* m/s^2 per count */
    uint16_t gyro_range_dps; /* deg/s */
    uint16_t accel_range_g;  /* g */
    uint16_t caps;           /* none defined in version 1 */
    const char *name;        /* ASCII, at most 219 bytes */
};

/* A whole HELLO frame; returns its length, or 0 if the name is too long. */
static inline size_t otolith_hello(uint8_t frame[OTOLITH_MAX_FRAME], uint8_t seq, const struct otolith_hello *hello)
{
    size_t name_length = strlen(hello->name);
    uint8_t *at = otolith_payload(frame);
    if (name_length > OTOLITH_MAX_PAYLOAD - OTOLITH_HELLO_SIZE)
        return 0;
    at = otolith_put_u8(at, OTOLITH_VERSION);
    at = otolith_put_u8(at, 0); /* flags, reserved */
    at = otolith_put_u32(at, hello->device_id);
    at = otolith_put_u16(at, hello->firmware);
    at = otolith_put_u32(at, hello->rate_mhz);
    at = otolith_put_f32(at, hello->gyro_scale);
    at = otolith_put_f32(at, hello->accel_scale);
    at = otolith_put_u16(at, hello->gyro_range_dps);
    at = otolith_put_u16(at, hello->accel_range_g);
    at = otolith_put_u16(at, hello->caps);
    at = otolith_put_u8(at, (uint8_t)name_length);
    memcpy(at, hello->name, name_length);
    return otolith_finish_frame(frame, OTOLITH_HELLO, seq, OTOLITH_HELLO_SIZE + name_length);
}

/* What STATUS says. The counts run since power-up, modulo 65536. */
struct otolith_status {
    uint64_t t_us;                 /* the samples' clock without its wrap */
    int16_t temperature_centi_deg; /* 0.01 deg C */
    uint32_t flags;                /* OTOLITH_FLAG_... */
    uint16_t dropped;              /* samples dropped before sending */
    uint16_t tx_overrun;           /* frames that did not fit the transmit queue */
    uint16_t sensor_err;           /* failed reads of the sensor */
};

/* A whole STATUS frame; returns its length, always 26. */
static inline size_t otolith_status(uint8_t frame[OTOLITH_MAX_FRAME], uint8_t seq, const struct otolith_status *status)
{
    uint8_t *at = otolith_put_u64(otolith_payload(frame), status->t_us);
    at = otolith_put_u16(at, (uint16_t)status->temperature_centi_deg);
    at = otolith_put_u32(at, status->flags);
    at = otolith_put_u16(at, status->dropped);
    at = otolith_put_u16(at, status->tx_overrun);
    at = otolith_put_u16(at, status->sensor_err);
    return otolith_finish_frame(frame, OTOLITH_STATUS, seq, (size_t)(at - otolith_payload(frame)));
}

/* A whole SYNC frame; returns its length, always 30. t1_us is the request's, t2_us when the request had come and t3_us
 * when this answer begins to leave, device time. */
static inline size_t otolith_sync(uint8_t frame[OTOLITH_MAX_FRAME], uint8_t seq, uint64_t t1_us, uint64_t t2_us,
                                  uint64_t t3_us)
{
    uint8_t *at = otolith_put_u64(otolith_payload(frame), t1_us);
    at = otolith_put_u64(at, t2_us);
    at = otolith_put_u64(at, t3_us);
    return otolith_finish_frame(frame, OTOLITH_SYNC, seq, (size_t)(at - otolith_payload(frame)));
}

/* A whole TEXT frame; returns its length, or 0 if the line is longer than 246 bytes. */
static inline size_t otolith_text(uint8_t frame[OTOLITH_MAX_FRAME], uint8_t seq, const char *line)
{
    size_t length = strlen(line);
    if (length > OTOLITH_MAX_PAYLOAD)
        return 0;
    memcpy(otolith_payload(frame), line, length);
    return otolith_finish_frame(frame, OTOLITH_TEXT, seq, length);
}

/* What the host asks. */
struct otolith_cmd {
    uint8_t code; /* enum otolith_command, or one of a later version */
    uint32_t arg;
    uint8_t token;
};

/* A whole ACK frame; returns its length, always 13. value is the one now in force. */
static inline size_t otolith_ack(uint8_t frame[OTOLITH_MAX_FRAME], uint8_t seq, const struct otolith_cmd *cmd,
                                 uint8_t result, uint32_t value)
{
    uint8_t *at = otolith_put_u8(otolith_payload(frame), cmd->code);
    at = otolith_put_u8(at, result);
    at = otolith_put_u32(at, value);
    at = otolith_put_u8(at, cmd->token);
    return otolith_finish_frame(frame, OTOLITH_ACK, seq, (size_t)(at - otolith_payload(frame)));
}

/* ---------------------------------------------------------------- receiving: little-endian fields */

static inline uint16_t otolith_u16_at(const uint8_t *at)
{
    return (uint16_t)(at[0] | (uint16_t)((uint16_t)at[1] << 8));
}

static inline uint32_t otolith_u32_at(const uint8_t *at)
{
    return otolith_u16_at(at) | (uint32_t)otolith_u16_at(at + 2) << 16;
}

static inline uint64_t otolith_u64_at(const uint8_t *at)
{
    return otolith_u32_at(at) | (uint64_t)otolith_u32_at(at + 4) << 32;
}

/* ---------------------------------------------------------------- receiving: what stood between two delimiters */

#define OTOLITH_FRAMING_ERROR (-1) /* no frame: broken COBS, too short or too long */
#define OTOLITH_CRC_ERROR (-2)

/* Where type, sequence number and payload of a piece are, once otolith_open_frame has undone its COBS. */
#define OTOLITH_TYPE_AT 1
#define OTOLITH_SEQ_AT 2
#define OTOLITH_PAYLOAD_AT 3

/* Undoes COBS in place and checks the CRC of a piece, the delimiter left out. Returns the length of its payload, or
 * OTOLITH_FRAMING_ERROR or OTOLITH_CRC_ERROR: drop the piece then. An empty piece (two delimiters in a row) is a
 * framing error here; it is legal, so do not count it. */
static inline int otolith_open_frame(uint8_t *piece, size_t length)
{
    size_t at = 0;
    if (length < 1 + 4 || length > OTOLITH_MAX_FRAME - 1)
        return OTOLITH_FRAMING_ERROR;
    for (;;) {
        size_t next = at + piece[at];
        if (next == at || next > length)
            return OTOLITH_FRAMING_ERROR;
        piece[at] = 0; /* the first is the COBS byte, which is no part of the body */
        if (next == length)
            break;
        at = next;
    }
    if (otolith_crc16(piece + 1, length - 3) != otolith_u16_at(piece + length - 2))
        return OTOLITH_CRC_ERROR;
    return (int)(length - OTOLITH_PAYLOAD_AT - 2);
}

/* Reads the OTOLITH_CMD_SIZE bytes of a CMD. */
static inline struct otolith_cmd otolith_cmd_at(const uint8_t *payload)
{
    struct otolith_cmd cmd;
    cmd.code = payload[0];
    cmd.arg = otolith_u32_at(payload + 1);
    cmd.token = payload[5];
    return cmd;
}

/* ---------------------------------------------------------------- classic CAN data */

/* The 8 data bytes of GYRO or ACCEL; tick = low 16 bits of the device time in 10 us units. */
static inline void otolith_can_half(uint8_t data[OTOLITH_CAN_DLC], const int16_t xyz[3], uint16_t tick)
{
    otolith_put_u16(otolith_put_i16x3(data, xyz), tick);
}

#ifdef __cplusplus
}
#endif

#endif
