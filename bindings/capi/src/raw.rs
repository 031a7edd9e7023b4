//! What crosses the boundary as a pointer, checked as far as it can be.

use crate::error::Failure;
use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;
use std::time::Duration;

/// The place behind an out parameter.
///
/// # Safety
/// Points 1 of the contract: NULL, or room for a `T` that nobody else uses during the call.
#[inline]
pub(crate) unsafe fn place<'a, T>(pointer: *mut T, what: &str) -> Result<&'a mut MaybeUninit<T>, Failure> {
    check(pointer, what)?;
    // SAFETY: neither NULL nor misaligned, and the caller promises the rest.
    Ok(unsafe { &mut *pointer.cast() })
}

/// A structure that the caller has filled in.
///
/// # Safety
/// Point 1 of the contract: NULL, or a `T`.
pub(crate) unsafe fn given<'a, T>(pointer: *const T, what: &str) -> Result<&'a T, Failure> {
    check(pointer, what)?;
    // SAFETY: neither NULL nor misaligned, and the caller promises the rest.
    Ok(unsafe { &*pointer })
}

/// `n` structures in a row; NULL will do for none.
///
/// # Safety
/// Point 1 of the contract: NULL, or `n` of `T`.
pub(crate) unsafe fn row<'a, T>(pointer: *const T, n: usize, what: &str) -> Result<&'a [T], Failure> {
    if n == 0 {
        return Ok(&[]);
    }
    check(pointer, what)?;
    if n > isize::MAX as usize / size_of::<T>().max(1) {
        return Err(Failure::argument(format!("{what}: {n} elements do not fit into memory")));
    }
    // SAFETY: neither NULL nor misaligned nor too long, and the caller promises the rest.
    Ok(unsafe { std::slice::from_raw_parts(pointer, n) })
}

/// A string.
///
/// # Safety
/// Point 2 of the contract: NULL, or bytes that end with a zero.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Failure> {
    check(pointer, what)?;
    // SAFETY: not NULL, and the caller promises the zero at its end.
    let bytes = unsafe { CStr::from_ptr(pointer) };
    bytes.to_str().map_err(|e| Failure::argument(format!("{what} is not UTF-8: {e}")))
}

#[inline]
fn check<T>(pointer: *const T, what: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(Failure::null(what));
    }
    if !pointer.is_aligned() {
        return Err(Failure::argument(format!("{what} is not aligned to {} bytes", align_of::<T>())));
    }
    Ok(())
}

/// Seconds as a time to wait; beyond 30 years it is for ever.
pub(crate) fn seconds(seconds: f64, what: &str) -> Result<Duration, Failure> {
    if seconds.is_nan() || seconds < 0.0 {
        return Err(Failure::argument(format!("expected {what} of 0 seconds or more, found {seconds}")));
    }
    // To the nanosecond below: cheaper than the correctly rounded conversion, for a step pays it.
    let seconds = seconds.min(1e9);
    let whole = seconds as u64;
    Ok(Duration::new(whole, ((seconds - whole as f64) * 1e9) as u32))
}

/// A word that is given by its number.
pub(crate) fn word<T: Copy>(all: &[T], number: u32, what: &str) -> Result<T, Failure> {
    let found = all.get(number as usize).copied();
    found.ok_or_else(|| Failure::argument(format!("expected {what} of 0 to {}, found {number}", all.len() - 1)))
}

/// A field that means nothing yet: 0, so that what a later version puts there is not dropped in silence.
pub(crate) fn reserved(number: u32, what: &str) -> Result<(), Failure> {
    word(&[()], number, what)
}

/// Yes or no.
pub(crate) fn flag(number: u32, what: &str) -> Result<bool, Failure> {
    word(&[false, true], number, what)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::{ERROR_ARGUMENT, ERROR_NULL};

    #[test]
    fn pointers_are_checked_before_they_are_followed() {
        let mut numbers = [1u64, 2, 3];
        let odd = numbers.as_ptr().cast::<u8>().wrapping_add(1).cast::<u64>();
        // SAFETY: the pointers are NULL, of the array's three elements, or refused for their address.
        unsafe {
            assert_eq!(row(numbers.as_ptr(), 3, "numbers").unwrap(), [1, 2, 3]);
            assert!(row::<u64>(std::ptr::null(), 0, "numbers").unwrap().is_empty());
            assert_eq!(row::<u64>(std::ptr::null(), 1, "numbers").unwrap_err().reported(), ERROR_NULL);
            assert_eq!(row(numbers.as_ptr(), usize::MAX, "numbers").unwrap_err().reported(), ERROR_ARGUMENT);
            assert_eq!(given(odd, "a number").unwrap_err().reported(), ERROR_ARGUMENT);
            assert_eq!(place(odd.cast_mut(), "a number").unwrap_err().reported(), ERROR_ARGUMENT);
            place(&raw mut numbers[1], "a number").unwrap().write(7);
            assert_eq!(text(c"straße".as_ptr(), "a word").unwrap(), "straße");
            assert_eq!(text(c"\xff".as_ptr(), "a word").unwrap_err().reported(), ERROR_ARGUMENT);
        }
        assert_eq!(numbers, [1, 7, 3]);
    }

    #[test]
    fn times_and_words_have_their_range() {
        assert_eq!(seconds(0.5, "a timeout").unwrap(), Duration::from_millis(500));
        assert_eq!(seconds(f64::INFINITY, "a timeout").unwrap(), Duration::from_secs(1_000_000_000));
        for bad in [-1e-9, f64::NAN, f64::NEG_INFINITY] {
            assert_eq!(seconds(bad, "a timeout").unwrap_err().reported(), ERROR_ARGUMENT, "{bad}");
        }
        assert_eq!(flag(2, "a flag").unwrap_err().reported(), ERROR_ARGUMENT);
        assert!(flag(1, "a flag").unwrap() && !flag(0, "a flag").unwrap());
    }
}
