#include "mpu6050.h"

#include <math.h>
#include <string.h>

#include <simavr/avr_twi.h>

#define ADDRESS 0x68

#define GYRO_CONFIG 0x1B
#define ACCEL_CONFIG 0x1C
#define ACCEL_XOUT_H 0x3B
#define TEMP_OUT_H 0x41
#define GYRO_XOUT_H 0x43
#define PWR_MGMT_1 0x6B
#define WHO_AM_I 0x75

#define SLEEP 0x40
#define TEMPERATURE_DEG 25.0

static double time_s(const struct mpu6050 *sensor)
{
    return (double)(sensor->avr->cycle - sensor->power_up_cycle) / sensor->avr->frequency;
}

static void reset_registers(struct mpu6050 *sensor)
{
    memset(sensor->registers, 0, sizeof sensor->registers);
    sensor->registers[PWR_MGMT_1] = SLEEP;
    sensor->registers[WHO_AM_I] = ADDRESS;
}

static void put_word(struct mpu6050 *sensor, uint8_t at, double counts)
{
    double held = fmin(fmax(round(counts), INT16_MIN), INT16_MAX);
    uint16_t word = (uint16_t)(int16_t)held;
    sensor->registers[at] = (uint8_t)(word >> 8);
    sensor->registers[at + 1] = (uint8_t)word;
}

/* Fills the measurement registers with what the sensor feels now, in its ranges of now. */
static void measure(struct mpu6050 *sensor)
{
    if (sensor->registers[PWR_MGMT_1] & SLEEP)
        return;
    struct motion_state state = motion_at(sensor->motion, time_s(sensor));
    double gyro_range_dps = 250 << (sensor->registers[GYRO_CONFIG] >> 3 & 3);
    double accel_range_g = 2 << (sensor->registers[ACCEL_CONFIG] >> 3 & 3);
    for (uint8_t axis = 0; axis < 3; axis++) {
        put_word(sensor, ACCEL_XOUT_H + 2 * axis, state.specific_force_g[axis] / accel_range_g * 32768);
        put_word(sensor, GYRO_XOUT_H + 2 * axis, state.omega_dps[axis] / gyro_range_dps * 32768);
    }
    put_word(sensor, TEMP_OUT_H, (TEMPERATURE_DEG - 36.53) * 340);
}

/* A sensor that has lost its power forgets, whether or not anybody asked in the meantime. */
static bool is_plugged_in(struct mpu6050 *sensor)
{
    double now_s = time_s(sensor);
    if (now_s >= sensor->unplugged_from_s && sensor->asked_s < sensor->unplugged_to_s)
        reset_registers(sensor);
    sensor->asked_s = now_s;
    return now_s < sensor->unplugged_from_s || now_s >= sensor->unplugged_to_s;
}

static void answer(struct mpu6050 *sensor, uint8_t what, uint8_t address, uint8_t data)
{
    avr_raise_irq(sensor->to_bus, avr_twi_irq_msg(what, address, data));
}

static void on_start(struct mpu6050 *sensor, uint8_t address)
{
    sensor->addressed = address >> 1 == ADDRESS && is_plugged_in(sensor);
    if (!sensor->addressed)
        return;
    if (address & 1)
        measure(sensor);
    else
        sensor->pointer_next = true;
    answer(sensor, TWI_COND_ACK, address, 1);
}

static void on_write(struct mpu6050 *sensor, uint8_t byte)
{
    if (sensor->pointer_next)
        sensor->pointer = byte & 0x7F;
    else if (sensor->pointer != WHO_AM_I)
        sensor->registers[sensor->pointer++ & 0x7F] = byte;
    sensor->pointer_next = false;
}

/* What the bus says: one message for each start, byte and stop. */
static void on_bus(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    struct mpu6050 *sensor = param;
    avr_twi_msg_irq_t message = {.u.v = value};
    uint8_t what = message.u.twi.msg, address = message.u.twi.addr;
    if (what & TWI_COND_STOP)
        sensor->addressed = false;
    if (what & TWI_COND_START)
        on_start(sensor, address);
    if (!sensor->addressed)
        return;
    if (what & TWI_COND_WRITE) {
        on_write(sensor, message.u.twi.data);
        answer(sensor, TWI_COND_ACK, address, 1);
    }
    if (what & TWI_COND_READ) {
        answer(sensor, TWI_COND_READ, address, sensor->registers[sensor->pointer++ & 0x7F]);
    }
}

void mpu6050_connect(struct mpu6050 *sensor, avr_t *avr, const struct motion *motion)
{
    sensor->avr = avr;
    sensor->motion = motion;
    sensor->to_bus = avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_OUTPUT), on_bus, sensor);
    mpu6050_power_up(sensor);
}

void mpu6050_power_up(struct mpu6050 *sensor)
{
    sensor->power_up_cycle = sensor->avr->cycle;
    sensor->addressed = false;
    sensor->asked_s = 0;
    reset_registers(sensor);
}
