#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "wait.h"

/* 256 bytes: the indices wrap by themselves. One place stays free, so that full and empty differ. */
static uint8_t ring[256];
static volatile uint8_t ring_in, ring_out;

static struct uart_frame frames[2];
static uint8_t filling; /* of the interrupt */
static uint8_t taking;  /* of the main loop */

void uart_start(void)
{
    UCSR0A = _BV(U2X0); /* before the divisor: simavr 1.6 looks at it only then */
    UBRR0 = UART_DIVISOR - 1;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
}

ISR(USART_UDRE_vect)
{
    UDR0 = ring[ring_out++];
    if (ring_out == ring_in)
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
}

uint8_t uart_backlog(void)
{
    return ring_in - ring_out;
}

bool uart_send(const uint8_t *bytes, size_t length)
{
    if (length > (size_t)(255 - uart_backlog()))
        return false;
    uint8_t in = ring_in;
    for (size_t i = 0; i < length; i++)
        ring[in++] = bytes[i];
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        ring_in = in;
        UCSR0B |= _BV(UDRIE0);
    }
    return true;
}

ISR(USART_RX_vect)
{
    uint8_t byte = UDR0;
    struct uart_frame *frame = &frames[filling];
    if (frame->complete)
        return; /* both wait for the main loop; the CRC finds what is missing here */
    if (byte != 0) {
        if (frame->length < UART_FRAME_SIZE)
            frame->bytes[frame->length] = byte;
        if (frame->length <= UART_FRAME_SIZE)
            frame->length++; /* one above the size marks a piece that is too long */
        return;
    }
    if (frame->length == 0 || frame->length > UART_FRAME_SIZE) {
        frame->length = 0;
        return;
    }
    frame->received = clock_now_in_interrupt();
    frame->complete = true;
    filling ^= 1;
    work_waiting = true;
}

struct uart_frame *uart_received(void)
{
    struct uart_frame *frame = NULL;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (frames[taking].complete)
            frame = &frames[taking];
    }
    return frame;
}

void uart_frame_done(struct uart_frame *frame)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        frame->length = 0;
        frame->complete = false;
    }
    taking ^= 1;
}
