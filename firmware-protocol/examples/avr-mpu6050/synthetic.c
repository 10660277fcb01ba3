/* A chair instead of a sensor, for trying the whole chain without one: rest, spin up to 30 rpm, spin, stop, rest, again.
 * Exact integers, no noise. */
#include <stddef.h>

#include "sensor.h"

#define REST_US 3000000UL
#define RAMP_US 1000000UL
#define SPIN_US 10000000UL
#define REST_AFTER_US 15000000UL
#define ROUND_US (REST_US + RAMP_US + SPIN_US + RAMP_US + REST_AFTER_US)

/* 180 deg/s in counts of 500 / 32768 deg/s, rounded. */
#define SPIN_COUNTS 11796
#define ONE_G_COUNTS (32768 / ACCEL_RANGE_G)

const char sensor_name[] = "synthetic chair";

static uint32_t last_us;
static uint32_t round_us; /* since the round began */
static bool asked;

void sensor_begin(struct instant due)
{
    uint32_t now_us = (uint32_t)clock_us(due);
    round_us += now_us - last_us;
    if (round_us >= ROUND_US)
        round_us -= ROUND_US;
    last_us = now_us;
    asked = true;
}

/* Of a ramp from 0 to SPIN_COUNTS; the 100 keeps the product in 32 bits. */
static int16_t ramp(uint32_t since_us)
{
    return (int16_t)(since_us / 100 * SPIN_COUNTS / (RAMP_US / 100));
}

static int16_t yaw_rate(uint32_t at_us)
{
    if (at_us < REST_US)
        return 0;
    at_us -= REST_US;
    if (at_us < RAMP_US)
        return ramp(at_us);
    at_us -= RAMP_US;
    if (at_us < SPIN_US)
        return SPIN_COUNTS;
    at_us -= SPIN_US;
    if (at_us < RAMP_US)
        return SPIN_COUNTS - ramp(at_us);
    return 0;
}

bool sensor_poll(struct reading *reading)
{
    if (!asked)
        return false;
    asked = false;
    *reading = (struct reading){
        .gyro = {0, 0, yaw_rate(round_us)}, .accel = {0, 0, ONE_G_COUNTS}, .temperature_centi_deg = 2500};
    return true;
}

uint16_t sensor_errors(void)
{
    return 0;
}

const char *sensor_take_complaint(void)
{
    return NULL;
}
