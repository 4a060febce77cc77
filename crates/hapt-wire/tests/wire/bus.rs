//! A simulated USB controller, and the host at its other end. This file is compiled into the tests of this crate and into the program of an emulated
//! board.

use core::cell::RefCell;

use critical_section::Mutex;
use usb_device::bus::{PollResult, UsbBus};
use usb_device::endpoint::{EndpointAddress, EndpointType};
use usb_device::{Result, UsbDirection, UsbError};

const PACKET: usize = 64;
/// The length of the longest answer.
pub const MAX_TRANSFER_BYTES: usize = 1024;

/// The packets between device and host.
struct State {
    event: Option<PollResult>,
    setup: Option<[u8; 8]>,
    /// The packets to the control pipe and to the endpoint of reports.
    out: [Option<([u8; PACKET], usize)>; 2],
    /// The device's bytes to the control pipe since the last setup.
    answer: ([u8; MAX_TRANSFER_BYTES], usize),
    /// The endpoints, one bit each, with written packets of which the device has not been notified.
    written: u16,
    stalled: bool,
    /// The newest report of the wheel.
    report: ([u8; PACKET], usize),
}

/// The host.
pub struct Host(Mutex<RefCell<State>>);

impl Host {
    pub const fn new() -> Self {
        Host(Mutex::new(RefCell::new(State {
            event: None,
            setup: None,
            out: [None; 2],
            answer: ([0; MAX_TRANSFER_BYTES], 0),
            written: 0,
            stalled: false,
            report: ([0; PACKET], 0),
        })))
    }

    fn with<R>(&self, change: impl FnOnce(&mut State) -> R) -> R {
        critical_section::with(|section| change(&mut self.0.borrow_ref_mut(section)))
    }

    /// Resets, suspends or resumes the device at its next poll.
    pub fn signal(&self, event: PollResult) {
        self.with(|state| state.event = Some(event));
    }

    /// A control transfer with the device, which `poll` polls; returns the answer, or nothing where the device refuses.
    pub fn control<'r>(
        &self,
        setup: [u8; 8],
        data: &[u8],
        room: &'r mut [u8; MAX_TRANSFER_BYTES],
        mut poll: impl FnMut(),
    ) -> Option<&'r [u8]> {
        self.with(|state| {
            (state.setup, state.answer.1, state.stalled) = (Some(setup), 0, false);
            state.out[0] = None;
        });
        poll();
        if setup[0] & 0x80 == 0 {
            for packet in data.chunks(PACKET) {
                self.send(0, packet, &mut poll);
            }
        }
        // One packet of the answer per poll, and one poll for the notification of the last.
        for _ in 0..2 + MAX_TRANSFER_BYTES / PACKET {
            poll();
        }
        if setup[0] & 0x80 != 0 {
            self.send(0, &[], &mut poll);
        }
        self.with(|state| {
            *room = state.answer.0;
            (!state.stalled).then_some(state.answer.1)
        })
        .and_then(|length| room.get(..length))
    }

    /// Sends a packet to one of the endpoints, which the device takes at the next poll.
    pub fn send(&self, endpoint: usize, packet: &[u8], mut poll: impl FnMut()) {
        let mut bytes = [0; PACKET];
        bytes.iter_mut().zip(packet).for_each(|(place, byte)| *place = *byte);
        self.with(|state| state.out[endpoint] = Some((bytes, packet.len())));
        poll();
    }

    /// The newest report of the wheel.
    pub fn report(&self) -> ([u8; PACKET], usize) {
        self.with(|state| state.report)
    }
}

/// The device's controller. `allocate` gives endpoints their addresses.
pub struct Controller<'h, A> {
    host: &'h Host,
    allocate: Mutex<A>,
}

impl<'h, A> Controller<'h, A> {
    pub fn new(host: &'h Host, allocate: A) -> Self {
        Controller { host, allocate: Mutex::new(allocate) }
    }
}

impl<A> UsbBus for Controller<'_, A>
where
    A: FnMut(UsbDirection, Option<EndpointAddress>, EndpointType, u16, u8) -> Result<EndpointAddress> + Send,
{
    fn alloc_ep(
        &mut self,
        direction: UsbDirection,
        address: Option<EndpointAddress>,
        kind: EndpointType,
        most: u16,
        interval: u8,
    ) -> Result<EndpointAddress> {
        self.allocate.get_mut()(direction, address, kind, most, interval)
    }

    fn enable(&mut self) {}

    fn reset(&self) {}

    fn set_device_address(&self, _: u8) {}

    fn write(&self, address: EndpointAddress, packet: &[u8]) -> Result<usize> {
        self.host.with(|state| {
            let (place, at) = if address.index() == 0 {
                let at = state.answer.1;
                (state.answer.0.get_mut(at..), &mut state.answer.1)
            } else {
                state.report.1 = 0;
                (state.report.0.get_mut(..), &mut state.report.1)
            };
            let place = place.and_then(|rest| rest.get_mut(..packet.len())).ok_or(UsbError::BufferOverflow)?;
            place.copy_from_slice(packet);
            *at += packet.len();
            state.written |= 1 << address.index();
            Ok(packet.len())
        })
    }

    fn read(&self, address: EndpointAddress, buffer: &mut [u8]) -> Result<usize> {
        self.host.with(|state| {
            if let Some(setup) = state.setup.take_if(|_| address.index() == 0) {
                buffer.get_mut(..8).ok_or(UsbError::BufferOverflow)?.copy_from_slice(&setup);
                return Ok(8);
            }
            let waiting = state.out.get_mut(address.index()).ok_or(UsbError::InvalidEndpoint)?;
            let (packet, length) = waiting.take().ok_or(UsbError::WouldBlock)?;
            buffer.iter_mut().zip(packet.iter().take(length)).for_each(|(place, byte)| *place = *byte);
            Ok(length)
        })
    }

    fn set_stalled(&self, address: EndpointAddress, stalled: bool) {
        self.host.with(|state| state.stalled |= stalled && address.index() == 0);
    }

    fn is_stalled(&self, _: EndpointAddress) -> bool {
        false
    }

    fn suspend(&self) {}

    fn resume(&self) {}

    fn poll(&self) -> PollResult {
        self.host.with(|state| {
            if let Some(event) = state.event.take() {
                return event;
            }
            let ep_setup = u16::from(state.setup.is_some());
            let ep_out = state.out.iter().enumerate().fold(0, |all, (at, out)| all | u16::from(out.is_some()) << at);
            let ep_in_complete = core::mem::take(&mut state.written);
            match ep_setup | ep_out | ep_in_complete {
                0 => PollResult::None,
                _ => PollResult::Data { ep_out, ep_in_complete, ep_setup },
            }
        })
    }
}
