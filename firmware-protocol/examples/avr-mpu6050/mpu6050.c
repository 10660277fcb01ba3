/* MPU-6050 at its default address. Register numbers and scales: "MPU-6000 and MPU-6050 Register Map and Descriptions",
 * revision 4.2, sections 4.1 to 4.5, 4.17 to 4.19, 4.28, 4.32. */
#include <stddef.h>

#include "sensor.h"
#include "twi.h"

#define ADDRESS 0x68 /* AD0 low */

#define SMPLRT_DIV 0x19 /* the first of four settings in a row */
#define ACCEL_XOUT_H 0x3B
#define MEASUREMENT_BYTES 14
#define PWR_MGMT_1 0x6B
#define WHO_AM_I 0x75

#define SAMPLE_EVERY_MS 0x00       /* the sensor's own rate divided by 1: 1 kHz */
#define LOW_PASS_42_HZ 0x03        /* 4.8 ms late */
#define GYRO_500_DPS (1 << 3)
#define ACCEL_4_G (1 << 3)
#define AWAKE_ON_GYRO_CLOCK 0x01
#define IDENTITY 0x68

/* Readings thrown away after the wake-up: the gyroscope needs 30 ms, the filter some more. */
#define SETTLING_READINGS 50

const char sensor_name[] = "MPU-6050";

/* One transfer per sample tick. Whatever fails starts again from the first: a sensor that was unplugged has forgotten
 * its settings. */
static enum { IDENTIFY, WAKE, CONFIGURE, MEASURE } step;
static bool bus_started;
static uint8_t settling;
static uint16_t errors;
static const char *complaint;
static bool complained;

static void fail(const char *why)
{
    errors++;
    step = IDENTIFY;
    if (!complained)
        complaint = why;
    complained = true;
}

static void request(void)
{
    static const uint8_t wake[] = {PWR_MGMT_1, AWAKE_ON_GYRO_CLOCK};
    static const uint8_t configure[] = {SMPLRT_DIV, SAMPLE_EVERY_MS, LOW_PASS_42_HZ, GYRO_500_DPS, ACCEL_4_G};
    static const uint8_t identity[] = {WHO_AM_I};
    static const uint8_t measurement[] = {ACCEL_XOUT_H};
    switch (step) {
    case IDENTIFY:
        twi_transfer(ADDRESS, identity, sizeof identity, 1);
        break;
    case WAKE:
        twi_transfer(ADDRESS, wake, sizeof wake, 0);
        break;
    case CONFIGURE:
        twi_transfer(ADDRESS, configure, sizeof configure, 0);
        break;
    case MEASURE:
        twi_transfer(ADDRESS, measurement, sizeof measurement, MEASUREMENT_BYTES);
        break;
    }
}

void sensor_begin(struct instant due)
{
    (void)due;
    if (!bus_started) {
        twi_start();
        bus_started = true;
    }
    if (twi_state() == TWI_BUSY) { /* a whole period was not enough */
        fail("MPU-6050: the I2C bus is stuck; check SDA and SCL");
        twi_start();
    }
    request();
}

static int16_t big_endian(const uint8_t *at)
{
    return (int16_t)((uint16_t)at[0] << 8 | at[1]);
}

/* Specific force, temperature, angular rate: seven words in a row, of one moment. */
static void read_measurement(const uint8_t *in, struct reading *reading)
{
    for (uint8_t axis = 0; axis < 3; axis++) {
        reading->accel[axis] = big_endian(in + 2 * axis);
        reading->gyro[axis] = big_endian(in + 8 + 2 * axis);
    }
    /* raw / 340 + 36.53 deg C; 100 / 340 = 5 / 17 */
    reading->temperature_centi_deg = (int16_t)((int32_t)big_endian(in + 6) * 5 / 17 + 3653);
}

/* After a loss of power the sensor sleeps and its registers are zero. A real reading never is: at the temperature whose
 * count is zero, 36.53 deg C, it would have to fall freely. */
static bool asleep(const uint8_t *in)
{
    uint8_t bits = 0;
    for (uint8_t at = 0; at < MEASUREMENT_BYTES; at++)
        bits |= in[at];
    return bits == 0;
}

/* What a finished transfer means; true with a reading. */
static bool advance(const uint8_t *in, struct reading *reading)
{
    switch (step) {
    case IDENTIFY:
        if (in[0] == IDENTITY)
            step = WAKE;
        else
            fail("the sensor at I2C address 0x68 is no MPU-6050");
        return false;
    case WAKE:
        step = CONFIGURE;
        return false;
    case CONFIGURE:
        step = MEASURE;
        settling = SETTLING_READINGS;
        return false;
    case MEASURE:
        if (asleep(in)) {
            fail("the MPU-6050 lost its power for a moment; check VCC and GND");
            return false;
        }
        if (settling > 0) {
            settling--;
            return false;
        }
        complained = false;
        read_measurement(in, reading);
        return true;
    }
    return false;
}

bool sensor_poll(struct reading *reading)
{
    switch (twi_state()) {
    case TWI_DONE:
        return advance(twi_take(), reading);
    case TWI_FAILED:
        twi_take();
        fail("no answer from an MPU-6050 at I2C address 0x68; check VCC, GND, SDA and SCL");
        return false;
    default:
        return false;
    }
}

uint16_t sensor_errors(void)
{
    return errors;
}

const char *sensor_take_complaint(void)
{
    const char *taken = complaint;
    complaint = NULL;
    return taken;
}
