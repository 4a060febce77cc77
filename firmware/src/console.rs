//! The host's console and files, by ARM's semihosting: the output of a program on QEMU or under a debugger, without other hardware.

use core::arch::asm;
use core::ffi::CStr;
use core::fmt;

const OPEN: usize = 0x01;
const WRITE: usize = 0x05;
const READ: usize = 0x06;
const EXIT: usize = 0x20;

/// One operation of "Semihosting for AArch32 and AArch64" (ARM, 2.0): its number in r0, its parameters' address in r1.
fn call(operation: usize, parameters: &[usize]) -> usize {
    let result;
    // SAFETY: the breakpoint reads the parameters, and writes only to their addresses: see each of the callers.
    unsafe { asm!("bkpt 0xab", inlateout("r0") operation => result, in("r1") parameters.as_ptr()) };
    result
}

/// A file of the host.
pub struct File(usize);

impl File {
    /// The console, to write on.
    pub fn console() -> File {
        File::open(c":tt", 4)
    }

    /// To read from.
    pub fn read_from(name: &CStr) -> File {
        File::open(name, 1)
    }

    fn open(name: &CStr, mode: usize) -> File {
        File(call(OPEN, &[name.as_ptr() as usize, mode, name.count_bytes()]))
    }

    /// Fills the whole buffer, or returns that the file ends earlier.
    pub fn fill(&mut self, room: &mut [u8]) -> bool {
        // The host writes into the room, no further than its length.
        call(READ, &[self.0, room.as_mut_ptr() as usize, room.len()]) == 0
    }
}

impl fmt::Write for File {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let unwritten = call(WRITE, &[self.0, text.as_ptr() as usize, text.len()]);
        if unwritten == 0 { Ok(()) } else { Err(fmt::Error) }
    }
}

/// Ends the emulator with this exit code.
pub fn exit(code: usize) -> ! {
    const APPLICATION_EXIT: usize = 0x20026;
    call(EXIT, &[APPLICATION_EXIT, code]);
    loop {}
}
