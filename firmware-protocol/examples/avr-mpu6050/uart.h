/* UART 0 by interrupts, 8N1: a ring of bytes out, a ring of two frames in. */
#ifndef UART_H
#define UART_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "clock.h"
#include "otolith_protocol.h"

/* The divisor for double speed, rounded, and what comes of it. */
#define UART_DIVISOR ((F_CPU / 8 + BAUD / 2) / BAUD)
#define UART_REAL_BAUD (F_CPU / 8 / UART_DIVISOR)

#if UART_REAL_BAUD * 1000 > BAUD * 1025 || UART_REAL_BAUD * 1000 < BAUD * 975
#error "BAUD is more than 2.5 % away from what the crystal can do: at 16 MHz take 115200, 250000, 500000 or 1000000"
#endif

/* Bytes a second, start and stop bits taken off. */
#define UART_BYTES_PER_SECOND (UART_REAL_BAUD / 10)

/* The longest frame a host sends is SYNC: payload, type, sequence number, CRC and COBS byte. */
#define UART_FRAME_SIZE (OTOLITH_SYNC_SIZE + 5)

/* What stood between two delimiters, never empty. */
struct uart_frame {
    uint8_t bytes[UART_FRAME_SIZE];
    uint8_t length;
    struct instant received; /* when its delimiter had come */
    bool complete;
};

void uart_start(void);

/* Queues all bytes, or none if they do not fit the ring: then false. */
bool uart_send(const uint8_t *bytes, size_t length);

/* Bytes in the ring. One or two more may be in the UART itself. */
uint8_t uart_backlog(void);

/* The oldest frame received, or NULL. It stays until uart_frame_done; while two wait, further ones are lost. */
struct uart_frame *uart_received(void);
void uart_frame_done(struct uart_frame *frame);

#endif
