/* I2C master by interrupts, 400 kHz: one transfer at a time, the CPU sleeps meanwhile. */
#ifndef TWI_H
#define TWI_H

#include <stdint.h>

#define TWI_MOST_OUT 5
#define TWI_MOST_IN 14

enum twi_state { TWI_IDLE, TWI_BUSY, TWI_DONE, TWI_FAILED };

/* Takes the bus, and frees it first from a device that was left in the middle of a byte. */
void twi_start(void);

/* Writes out_length bytes, 1 to TWI_MOST_OUT, then reads in_length, up to TWI_MOST_IN, if that is not 0. Not while
 * busy. `address` has 7 bits. */
void twi_transfer(uint8_t address, const uint8_t *out, uint8_t out_length, uint8_t in_length);

enum twi_state twi_state(void);

/* Ends what twi_state says is done or failed, and gives the bytes read. */
const uint8_t *twi_take(void);

#endif
