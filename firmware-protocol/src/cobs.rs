//! Consistent Overhead Byte Stuffing of one block: removes every zero byte at the cost of one byte.
//!
//! Each zero is replaced by the distance to the next one, and a byte in front holds the distance to the first
//! (Cheshire and Baker, IEEE/ACM Transactions on Networking 7, 1999). A frame is at most [`MAX_BODY`] bytes, so
//! the 0xFF code of longer blocks never occurs and both directions work in place.

use crate::MAX_BODY;

/// Longest encoded block, without delimiter, bytes.
pub const MAX_ENCODED: usize = MAX_BODY + 1;

/// A block that no encoder produces: a code that is zero or points past the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrokenBlock;

/// Encodes `block[1..]` in place; `block[0]` receives the first code. The delimiter is not written.
///
/// # Panics
/// If `block` is empty or longer than [`MAX_ENCODED`]: the caller sized the buffer wrongly.
pub fn encode_in_place(block: &mut [u8]) {
    assert!((1..=MAX_ENCODED).contains(&block.len()), "a COBS block holds 0 to {MAX_BODY} bytes");
    let mut code_at = 0;
    for at in 1..block.len() {
        if block[at] == 0 {
            block[code_at] = (at - code_at) as u8;
            code_at = at;
        }
    }
    block[code_at] = (block.len() - code_at) as u8;
}

/// Decodes a block without its delimiter in place; the result is `block[1..]`.
///
/// # Errors
/// [`BrokenBlock`] if a code is zero or points past the end (also for an empty or an overlong block); the
/// content of `block` is then unspecified.
pub fn decode_in_place(block: &mut [u8]) -> Result<&[u8], BrokenBlock> {
    if block.len() > MAX_ENCODED {
        return Err(BrokenBlock);
    }
    let mut code_at = 0;
    while code_at < block.len() {
        let code = usize::from(block[code_at]);
        if code == 0 {
            return Err(BrokenBlock);
        }
        block[code_at] = 0;
        code_at += code;
    }
    if code_at > block.len() {
        return Err(BrokenBlock);
    }
    block.get(1..).ok_or(BrokenBlock)
}
