//! Asks the driver of a serial port to hand bytes on at once. The only module of this layer with `unsafe`: no
//! dependency has a safe call for these two requests.

/// Sets `ASYNC_LOW_LATENCY` on the open port. False where the driver has no such flag, as pseudo-terminals and
/// many USB devices have none: they need none, or cannot be helped.
///
/// An FTDI bridge then forwards after 1 ms instead of 16 (`drivers/usb/serial/ftdi_sio.c`).
#[cfg(target_os = "linux")]
#[allow(unsafe_code)]
pub(super) fn request(port: &impl std::os::fd::AsRawFd) -> bool {
    /// `ASYNC_LOW_LATENCY` of `linux/tty_flags.h`.
    const LOW_LATENCY: libc::c_int = 1 << 13;

    /// `struct serial_struct` of `linux/serial.h`; only `flags` is used.
    #[repr(C)]
    struct SerialStruct {
        kind: libc::c_int,
        line: libc::c_int,
        port: libc::c_uint,
        irq: libc::c_int,
        flags: libc::c_int,
        xmit_fifo_size: libc::c_int,
        custom_divisor: libc::c_int,
        baud_base: libc::c_int,
        close_delay: libc::c_ushort,
        io_type: libc::c_char,
        reserved_char: [libc::c_char; 1],
        hub6: libc::c_int,
        closing_wait: libc::c_ushort,
        closing_wait2: libc::c_ushort,
        iomem_base: *mut libc::c_uchar,
        iomem_reg_shift: libc::c_ushort,
        port_high: libc::c_uint,
        iomap_base: libc::c_ulong,
    }

    // SAFETY: integers and a pointer, for which all zeros is valid.
    let mut settings: SerialStruct = unsafe { std::mem::zeroed() };
    // SAFETY: the descriptor is open, and the request writes at most one `serial_struct` to the pointer.
    if unsafe { libc::ioctl(port.as_raw_fd(), libc::TIOCGSERIAL, &raw mut settings) } != 0 {
        return false;
    }
    settings.flags |= LOW_LATENCY;
    // SAFETY: the descriptor is open, and the request reads one `serial_struct`, which the driver has just filled.
    unsafe { libc::ioctl(port.as_raw_fd(), libc::TIOCSSERIAL, &raw const settings) == 0 }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #[test]
    fn what_is_no_serial_port_has_no_such_flag() {
        let file = std::fs::File::open("/dev/null").expect("opens");
        assert!(!super::request(&file));
    }
}
