/* An MPU-6050 on the simulated I2C bus: what the firmware of ../avr-mpu6050 uses of it.
 *
 * Modelled: address 0x68, register pointer with increment, WHO_AM_I, sleep after power-up, ranges, the 14 measurement
 * registers, latched when a read begins. Not modelled: FIFO, interrupts, self-test, filter and its delay, noise, bias,
 * the sensor's own sampling, and the speed of the bus (simavr takes 9 us a byte whatever TWBR says). */
#ifndef MPU6050_H
#define MPU6050_H

#include <stdbool.h>
#include <stdint.h>

#include <simavr/sim_avr.h>

#include "motion.h"

struct mpu6050 {
    avr_t *avr;
    struct avr_irq_t *to_bus;
    const struct motion *motion;
    uint64_t power_up_cycle;             /* the motion's time 0 */
    double unplugged_from_s, unplugged_to_s; /* does not answer in between; equal: always there */
    double asked_s;                          /* when the bus last called it */
    uint8_t registers[128];
    uint8_t pointer;
    bool addressed;
    bool pointer_next; /* the next byte written is the register number */
};

/* Puts the sensor on the bus of `avr`. */
void mpu6050_connect(struct mpu6050 *sensor, avr_t *avr, const struct motion *motion);

/* The power has just come: all registers as in the data sheet, and the motion begins. */
void mpu6050_power_up(struct mpu6050 *sensor);

#endif
