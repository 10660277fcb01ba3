/* What the main loop knows of a sensor. Two files implement it: mpu6050.c and synthetic.c; the Makefile takes one. */
#ifndef SENSOR_H
#define SENSOR_H

#include <stdbool.h>
#include <stdint.h>

#include "clock.h"

/* Full scale of both sensors. */
#define GYRO_RANGE_DPS 500
#define ACCEL_RANGE_G 4

struct reading {
    int16_t gyro[3];               /* counts of GYRO_RANGE_DPS / 32768 */
    int16_t accel[3];              /* specific force, counts of ACCEL_RANGE_G / 32768 */
    int16_t temperature_centi_deg; /* 0.01 deg C */
};

/* For HELLO. */
extern const char sensor_name[];

/* Starts what one sample tick asks for; the answer comes by sensor_poll. */
void sensor_begin(struct instant due);

/* True with a reading, once per answer. */
bool sensor_poll(struct reading *reading);

/* Failed reads since power-up, modulo 65536. */
uint16_t sensor_errors(void);

/* A line for the log of the host, once per trouble; NULL otherwise. */
const char *sensor_take_complaint(void);

#endif
