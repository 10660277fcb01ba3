#include "twi.h"

#include <avr/cpufunc.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <string.h>
#include <util/delay.h>
#include <util/twi.h>

#include "wait.h"

#define CLOCK_HZ 400000UL
#define CLOCK_PIN PC5
#define DATA_PIN PC4

/* Interrupt flag cleared, interface on: the interface goes on with what the other bits say. */
#define GO (_BV(TWINT) | _BV(TWEN) | _BV(TWIE))
#define GO_START (GO | _BV(TWSTA))
#define GO_ACK (GO | _BV(TWEA))
#define STOP (_BV(TWINT) | _BV(TWEN) | _BV(TWSTO))

static volatile enum twi_state state;
static uint8_t target;
static uint8_t out[TWI_MOST_OUT], out_length, out_at;
static uint8_t in[TWI_MOST_IN], in_length, in_at;

/* A device reset in the middle of a read leaves the sensor holding the data line low until it has been clocked out of
 * its byte. The pins are pulled low or let go, never driven high. */
static void free_bus(void)
{
    PORTC &= (uint8_t)~(_BV(CLOCK_PIN) | _BV(DATA_PIN));
    for (uint8_t bit = 0; bit < 9 && !(PINC & _BV(DATA_PIN)); bit++) {
        DDRC |= _BV(CLOCK_PIN);
        _delay_us(5);
        DDRC &= (uint8_t)~_BV(CLOCK_PIN);
        _delay_us(5);
    }
}

void twi_start(void)
{
    TWCR = 0;
    free_bus();
    /* The board of the sensor has pull-ups; these weak ones keep the lines still where there is no sensor. */
    PORTC |= _BV(CLOCK_PIN) | _BV(DATA_PIN);
    TWSR = 0;
    TWBR = (F_CPU / CLOCK_HZ - 16) / 2;
    TWCR = _BV(TWEN);
    state = TWI_IDLE;
}

void twi_transfer(uint8_t address, const uint8_t *bytes, uint8_t length, uint8_t read_length)
{
    target = address;
    memcpy(out, bytes, length);
    out_length = length;
    out_at = 0;
    in_length = read_length;
    in_at = 0;
    state = TWI_BUSY;
    _MemoryBarrier(); /* the interrupt reads all of this */
    TWCR = GO_START;
}

enum twi_state twi_state(void)
{
    return state;
}

const uint8_t *twi_take(void)
{
    state = TWI_IDLE;
    _MemoryBarrier(); /* the interrupt wrote it */
    return in;
}

static void end(enum twi_state how)
{
    TWCR = STOP;
    state = how;
    work_waiting = true;
}

/* Next byte of the write, then the read or the end. */
static void go_on_writing(void)
{
    if (out_at < out_length) {
        TWDR = out[out_at++];
        TWCR = GO;
    } else if (in_length > 0) {
        TWCR = GO_START;
    } else {
        end(TWI_DONE);
    }
}

/* Asks for the next byte; the last one is not acknowledged. */
static void go_on_reading(void)
{
    TWCR = in_at + 1 < in_length ? GO_ACK : GO;
}

ISR(TWI_vect)
{
    switch (TW_STATUS) {
    case TW_START:
        TWDR = (uint8_t)(target << 1) | TW_WRITE;
        TWCR = GO;
        break;
    case TW_REP_START:
        TWDR = (uint8_t)(target << 1) | TW_READ;
        TWCR = GO;
        break;
    case TW_MT_SLA_ACK:
    case TW_MT_DATA_ACK:
        go_on_writing();
        break;
    case TW_MR_SLA_ACK:
        go_on_reading();
        break;
    case TW_MR_DATA_ACK:
        in[in_at++] = TWDR;
        go_on_reading();
        break;
    case TW_MR_DATA_NACK:
        in[in_at++] = TWDR;
        end(TWI_DONE);
        break;
    default: /* nobody answered, or the bus is broken */
        end(TWI_FAILED);
        break;
    }
}
