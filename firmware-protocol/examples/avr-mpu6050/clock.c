#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "wait.h"

#define BEAT_PERIOD ((uint16_t)(CLOCK_TICKS_PER_SECOND / 40))

/* All below belong to the interrupts; the main loop touches them with interrupts off. */
static volatile uint32_t wraps;
static volatile uint16_t sample_period;
static volatile bool tick_waiting;
static struct instant tick_due;
static volatile uint16_t missed_ticks;
static volatile uint8_t beats;

ISR(TIMER1_OVF_vect)
{
    wraps++;
}

struct instant clock_now_in_interrupt(void)
{
    struct instant now = {wraps, TCNT1};
    /* The timer has wrapped, but its interrupt still waits. A wrap after TCNT1 was read leaves a high count. */
    if ((TIFR1 & _BV(TOV1)) && now.ticks < 0x8000u)
        now.wraps++;
    return now;
}

ISR(TIMER1_COMPA_vect)
{
    uint16_t due = OCR1A;
    OCR1A = due + sample_period;
    if (tick_waiting)
        missed_ticks++;
    tick_due = clock_now_in_interrupt();
    if (tick_due.ticks < due)
        tick_due.wraps--; /* the timer wrapped between the tick and here */
    tick_due.ticks = due;
    tick_waiting = true;
    work_waiting = true;
}

ISR(TIMER1_COMPB_vect)
{
    OCR1B += BEAT_PERIOD;
    beats++;
    work_waiting = true;
}

void clock_start(uint16_t period)
{
    TCCR1A = 0;
    TCNT1 = 0;
    OCR1B = BEAT_PERIOD;
    clock_set_period(period);
    TIMSK1 = _BV(TOIE1) | _BV(OCIE1A) | _BV(OCIE1B);
    TCCR1B = _BV(CS11); /* F_CPU / 8, free-running */
}

void clock_set_period(uint16_t period)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        sample_period = period;
        OCR1A = TCNT1 + period;
        TIFR1 = _BV(OCF1A);
        tick_waiting = false;
    }
}

struct instant clock_now(void)
{
    struct instant now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        now = clock_now_in_interrupt();
    }
    return now;
}

bool clock_take_tick(struct instant *due)
{
    bool taken = false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (tick_waiting) {
            *due = tick_due;
            tick_waiting = false;
            taken = true;
        }
    }
    return taken;
}

bool clock_take_beat(void)
{
    bool taken = false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (beats > 0) {
            beats--;
            taken = true;
        }
    }
    return taken;
}

uint16_t clock_missed_ticks(void)
{
    uint16_t missed;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        missed = missed_ticks;
    }
    return missed;
}
