//! A USB bus whose host is at the other end of a stream: USB/IP in the form of Linux's vhci-hcd ("USB/IP protocol", in the kernel's documentation).
//!
//! The host sends transfers, and each is answered once; the device handles packets. This module divides a control transfer into packets: setup,
//! data, status.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use usb_device::bus::{PollResult, UsbBus};
use usb_device::endpoint::{EndpointAddress, EndpointType};
use usb_device::{UsbDirection, UsbError};

/// The length of every message without its data, in bytes.
pub const HEADER: usize = 48;
/// The largest data of a transfer, in bytes; those of a wheel are far shorter.
const MAX_TRANSFER_BYTES: usize = 4096;
/// The largest data of a control transfer to the device, in bytes.
const MAX_CONTROL_BYTES: usize = 128;
/// Endpoints in each direction, with the control pipe.
const ENDPOINTS: usize = 3;

const SUBMIT: u32 = 1;
const UNLINK: u32 = 2;
const SUBMITTED: u32 = 3;
const UNLINKED: u32 = 4;
/// The kernel's -EPIPE: the endpoint has stalled.
const STALLED: i32 = -32;
/// The kernel's -ECONNRESET: the transfer was unlinked before it was answered.
const ECONNRESET: i32 = -104;

/// The bytes of the stream are no message of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed;

/// A transfer that waits for its answer.
struct Transfer {
    number: u32,
    setup: [u8; 8],
    /// The data of a transfer to the device; the data collected so far of one from the device.
    data: Vec<u8>,
    /// Bytes that the device has read.
    read: usize,
    /// Bytes that the host has room for.
    room: usize,
    is_in: bool,
}

/// The stage of the first control transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The device has not been notified of its setup.
    Idle,
    /// Its setup can be read.
    Setup,
    /// The device writes the data.
    DataIn {
        /// A packet was sent, and the device has not been notified yet.
        sent: bool,
    },
    /// The device reads the data.
    DataOut,
    /// The device may read the empty status packet after the data that it wrote.
    StatusOut,
    /// The device is to write the empty status packet after the data that it read.
    StatusIn,
    /// The device has written the status, and has not been notified yet that it was sent.
    StatusSent,
}

struct State {
    is_reset: bool,
    used: [u8; 2],
    control: VecDeque<Transfer>,
    stage: Stage,
    /// To the device and from it, by endpoint.
    out: [VecDeque<Transfer>; ENDPOINTS],
    into: [VecDeque<Transfer>; ENDPOINTS],
    /// Packets that wait for a transfer of the host.
    ready: [Option<Vec<u8>>; ENDPOINTS],
    /// The endpoints, one bit each, whose packet was sent without a notification of the device yet.
    sent: u16,
    stalled: [u16; 2],
    answers: Vec<u8>,
}

/// The bus of one device.
pub struct Bus(Mutex<State>);

impl Default for Bus {
    fn default() -> Self {
        Bus(Mutex::new(State {
            is_reset: true,
            used: [0; 2],
            control: VecDeque::new(),
            stage: Stage::Idle,
            out: Default::default(),
            into: Default::default(),
            ready: Default::default(),
            sent: 0,
            stalled: [0; 2],
            answers: Vec::new(),
        }))
    }
}

/// The four bytes at `at`, most significant first.
fn word(header: &[u8; HEADER], at: usize) -> u32 {
    header[at..at + 4].iter().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

/// The bytes of data that follow this header.
pub fn data_length(header: &[u8; HEADER]) -> Result<usize, Malformed> {
    let is_out = word(header, 12) == 0;
    match word(header, 0) {
        SUBMIT => {
            let length = usize::try_from(word(header, 24)).map_err(|_| Malformed)?;
            match (length <= MAX_TRANSFER_BYTES, is_out) {
                (false, _) => Err(Malformed),
                (true, true) => Ok(length),
                (true, false) => Ok(0),
            }
        }
        UNLINK => Ok(0),
        _ => Err(Malformed),
    }
}

impl Bus {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a message of the host with its data.
    pub fn receive(&self, header: &[u8; HEADER], data: &[u8]) -> Result<(), Malformed> {
        let mut state = self.state();
        let number = word(header, 4);
        if word(header, 0) == UNLINK {
            state.unlink(number, word(header, 20));
            return Ok(());
        }
        let endpoint = usize::try_from(word(header, 16)).map_err(|_| Malformed)?;
        let is_in = word(header, 12) != 0;
        let room = word(header, 24) as usize;
        let mut setup = [0; 8];
        setup.copy_from_slice(&header[40..48]);
        let transfer = Transfer { number, setup, data: data.to_vec(), read: 0, room, is_in };
        if endpoint == 0 {
            state.control.push_back(transfer);
            return Ok(());
        }
        let bit = 1 << endpoint.min(15);
        let side = usize::from(is_in);
        let is_there = endpoint < ENDPOINTS && u16::from(state.used[side]) & bit != 0;
        if !is_there || state.stalled[side] & bit != 0 {
            state.answer(&transfer, STALLED, &[]);
        } else if is_in {
            state.into[endpoint].push_back(transfer);
            state.deliver(endpoint);
        } else {
            state.out[endpoint].push_back(transfer);
        }
        Ok(())
    }

    /// The bytes for the host since the last call.
    pub fn answers(&self) -> Vec<u8> {
        std::mem::take(&mut self.state().answers)
    }
}

impl State {
    fn answer(&mut self, transfer: &Transfer, status: i32, data: &[u8]) {
        let data = &data[..data.len().min(transfer.room)];
        let length = if transfer.is_in { data.len() } else { transfer.read };
        self.say(SUBMITTED, transfer.number, status, length);
        if transfer.is_in {
            self.answers.extend_from_slice(data);
        }
    }

    fn say(&mut self, command: u32, number: u32, status: i32, length: usize) {
        let begin = self.answers.len();
        for word in [command, number, 0, 0, 0, status as u32, length as u32] {
            self.answers.extend_from_slice(&word.to_be_bytes());
        }
        self.answers.resize(begin + HEADER, 0);
    }

    /// The host unlinks a transfer.
    fn unlink(&mut self, number: u32, which: u32) {
        let waits = |queue: &VecDeque<Transfer>| queue.iter().position(|transfer| transfer.number == which);
        let mut found = false;
        if let Some(at) = waits(&self.control) {
            self.control.remove(at);
            if at == 0 {
                // The device drops it at the next setup.
                self.stage = Stage::Idle;
            }
            found = true;
        }
        for queue in self.out.iter_mut().chain(&mut self.into) {
            if let Some(at) = waits(queue) {
                queue.remove(at);
                found = true;
            }
        }
        self.say(UNLINKED, number, if found { ECONNRESET } else { 0 }, 0);
    }

    /// Ends the first control transfer.
    fn end_control(&mut self, status: i32) {
        self.stage = Stage::Idle;
        if let Some(mut transfer) = self.control.pop_front() {
            let data = std::mem::take(&mut transfer.data);
            self.answer(&transfer, status, if status == 0 { &data } else { &[] });
        }
    }

    /// Answers a transfer with a packet, where there are both.
    fn deliver(&mut self, endpoint: usize) {
        // A packet without a transfer stays, so that the device can detect that it is unread.
        if let Some(packet) = self.ready[endpoint].take_if(|_| !self.into[endpoint].is_empty())
            && let Some(transfer) = self.into[endpoint].pop_front()
        {
            self.answer(&transfer, 0, &packet);
            self.sent |= 1 << endpoint;
        }
    }

    fn write_control(&mut self, packet: &[u8]) -> Result<usize, UsbError> {
        let Some(transfer) = self.control.front_mut() else { return Err(UsbError::WouldBlock) };
        match self.stage {
            Stage::DataIn { sent: false } => {
                transfer.data.extend_from_slice(packet);
                let ends = packet.len() < usize::from(hapt_wire::usb::PACKET) || transfer.data.len() >= transfer.room;
                self.stage = if ends { Stage::StatusOut } else { Stage::DataIn { sent: true } };
                Ok(packet.len())
            }
            Stage::StatusIn => {
                self.stage = Stage::StatusSent;
                Ok(packet.len())
            }
            // The empty packet after the last full one, which the host has not requested.
            Stage::StatusOut => Ok(packet.len()),
            Stage::Idle | Stage::Setup | Stage::DataIn { sent: true } | Stage::DataOut | Stage::StatusSent => {
                Err(UsbError::WouldBlock)
            }
        }
    }

    fn read_control(&mut self, buffer: &mut [u8]) -> Result<usize, UsbError> {
        let Some(transfer) = self.control.front_mut() else { return Err(UsbError::WouldBlock) };
        match self.stage {
            Stage::Setup => {
                let length = usize::from(u16::from_le_bytes([transfer.setup[6], transfer.setup[7]]));
                let is_in = transfer.setup[0] & 0x80 != 0;
                transfer.room = transfer.room.min(length);
                self.stage = match (is_in, length) {
                    (true, _) => Stage::DataIn { sent: false },
                    (false, 0) => Stage::StatusIn,
                    (false, _) => Stage::DataOut,
                };
                let setup = transfer.setup;
                fill(buffer, &setup)
            }
            Stage::DataOut => {
                let taken = fill(buffer, packet(transfer))?;
                transfer.read += taken;
                if transfer.read >= transfer.data.len() {
                    self.stage = Stage::StatusIn;
                }
                Ok(taken)
            }
            Stage::StatusOut => {
                self.end_control(0);
                Ok(0)
            }
            Stage::Idle | Stage::DataIn { .. } | Stage::StatusIn | Stage::StatusSent => Err(UsbError::WouldBlock),
        }
    }

    fn poll_control(&mut self) -> (bool, bool, bool) {
        let (mut setup, mut out, mut gone) = (false, false, false);
        match self.stage {
            Stage::Idle => {
                if let Some(transfer) = self.control.front() {
                    let length = usize::from(u16::from_le_bytes([transfer.setup[6], transfer.setup[7]]));
                    let is_out = transfer.setup[0] & 0x80 == 0;
                    // The setup contradicts the transfer.
                    let contradicts = is_out == transfer.is_in && length > 0 || is_out && transfer.data.len() != length;
                    if contradicts || is_out && length > MAX_CONTROL_BYTES {
                        self.end_control(STALLED);
                    } else {
                        self.stage = Stage::Setup;
                        setup = true;
                    }
                }
            }
            Stage::Setup => setup = true,
            Stage::DataIn { sent: true } => {
                self.stage = Stage::DataIn { sent: false };
                gone = true;
            }
            Stage::DataOut | Stage::StatusOut => out = true,
            Stage::StatusSent => {
                self.end_control(0);
                gone = true;
            }
            Stage::DataIn { sent: false } | Stage::StatusIn => {}
        }
        (setup, out, gone)
    }
}

/// The next packet of a transfer.
fn packet(transfer: &Transfer) -> &[u8] {
    let rest = &transfer.data[transfer.read.min(transfer.data.len())..];
    &rest[..rest.len().min(usize::from(hapt_wire::usb::PACKET))]
}

fn fill(buffer: &mut [u8], packet: &[u8]) -> Result<usize, UsbError> {
    let place = buffer.get_mut(..packet.len()).ok_or(UsbError::BufferOverflow)?;
    place.copy_from_slice(packet);
    Ok(packet.len())
}

impl UsbBus for Bus {
    fn alloc_ep(
        &mut self,
        direction: UsbDirection,
        address: Option<EndpointAddress>,
        kind: EndpointType,
        _: u16,
        _: u8,
    ) -> Result<EndpointAddress, UsbError> {
        let state = self.0.get_mut().unwrap_or_else(PoisonError::into_inner);
        let used = &mut state.used[usize::from(direction == UsbDirection::In)];
        let free = match address {
            Some(address) => address.index(),
            None if kind == EndpointType::Control => 0,
            None => (1..ENDPOINTS).find(|index| *used & 1 << index == 0).ok_or(UsbError::EndpointOverflow)?,
        };
        if free >= ENDPOINTS {
            return Err(UsbError::EndpointOverflow);
        }
        *used |= 1 << free;
        Ok(EndpointAddress::from_parts(free, direction))
    }

    fn enable(&mut self) {}

    fn reset(&self) {
        let mut state = self.state();
        state.ready = Default::default();
        (state.sent, state.stalled) = (0, [0; 2]);
    }

    /// The kernel does not pass on addresses.
    fn set_device_address(&self, _: u8) {}

    fn write(&self, address: EndpointAddress, packet: &[u8]) -> Result<usize, UsbError> {
        let mut state = self.state();
        match address.index() {
            0 => state.write_control(packet),
            index if index >= ENDPOINTS => Err(UsbError::InvalidEndpoint),
            index if state.ready[index].is_some() => Err(UsbError::WouldBlock),
            index => {
                state.ready[index] = Some(packet.to_vec());
                state.deliver(index);
                Ok(packet.len())
            }
        }
    }

    fn read(&self, address: EndpointAddress, buffer: &mut [u8]) -> Result<usize, UsbError> {
        let mut state = self.state();
        let index = address.index();
        if index == 0 {
            return state.read_control(buffer);
        }
        let queue = state.out.get_mut(index).ok_or(UsbError::InvalidEndpoint)?;
        let transfer = queue.front_mut().ok_or(UsbError::WouldBlock)?;
        let taken = fill(buffer, packet(transfer))?;
        transfer.read += taken;
        let is_read = transfer.read >= transfer.data.len();
        if is_read && let Some(transfer) = queue.pop_front() {
            state.answer(&transfer, 0, &[]);
        }
        Ok(taken)
    }

    fn set_stalled(&self, address: EndpointAddress, stalled: bool) {
        let mut state = self.state();
        if address.index() == 0 {
            // A stall of the control endpoint ends with the next setup.
            if stalled && state.stage != Stage::Idle {
                state.end_control(STALLED);
            }
            return;
        }
        let bit = 1 << address.index().min(15);
        let side = usize::from(address.is_in());
        if stalled {
            state.stalled[side] |= bit;
        } else {
            state.stalled[side] &= !bit;
        }
    }

    fn is_stalled(&self, address: EndpointAddress) -> bool {
        self.state().stalled[usize::from(address.is_in())] & 1 << address.index().min(15) != 0
    }

    fn suspend(&self) {}

    fn resume(&self) {}

    fn poll(&self) -> PollResult {
        let mut state = self.state();
        if std::mem::take(&mut state.is_reset) {
            return PollResult::Reset;
        }
        let (setup, out, gone) = state.poll_control();
        let mut ep_out = u16::from(out);
        for (index, queue) in state.out.iter().enumerate().skip(1) {
            ep_out |= u16::from(!queue.is_empty()) << index;
        }
        let ep_in_complete = std::mem::take(&mut state.sent) | u16::from(gone);
        let ep_setup = u16::from(setup);
        if ep_out | ep_in_complete | ep_setup == 0 {
            PollResult::None
        } else {
            PollResult::Data { ep_out, ep_in_complete, ep_setup }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use hapt_testing::prelude::*;
    use hapt_wire::pid::id;
    use hapt_wire::usb::WheelClass;
    use usb_device::bus::UsbBusAllocator;

    use super::{Bus, HEADER, SUBMIT, UNLINK, data_length, word};

    /// A message with its data: random words, or those of a plausible transfer.
    fn messages() -> impl Strategy<Value = Vec<u8>> {
        let setup = prop_oneof![
            any::<[u8; 8]>(),
            // HID's and standard requests to the interface, with lengths near those of packets.
            (
                prop_oneof![Just(0x21), Just(0xa1), Just(0x81), Just(0x80), Just(0)],
                0..12_u8,
                0..16_u8,
                0..4_u8,
                0..140_u8
            )
                .prop_map(|(kind, request, low, high, length)| [kind, request, low, high, 0, 0, length, 0]),
        ];
        let data = prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..200),
            // Reports that may be complete.
            (id::WHEEL..=id::POOL, proptest::collection::vec(0..20_u8, 0..15))
                .prop_map(|(id, rest)| [vec![id], rest].concat()),
        ];
        let command = prop_oneof![8 => Just(SUBMIT), 2 => Just(UNLINK)];
        (command, 0..30_u32, any::<bool>(), 0..4_u32, 0..200_u32, setup, data, any::<bool>()).prop_map(
            |(command, number, is_in, endpoint, room, mut setup, data, agrees)| {
                let is_in = if agrees && endpoint == 0 { setup[0] & 0x80 != 0 } else { is_in };
                let is_out = !is_in && command == SUBMIT;
                let length = if is_out { data.len() as u32 } else { room };
                if agrees && is_out {
                    setup[6] = length as u8;
                    setup[7] = 0;
                }
                // The word of the length is the number of the unlinked transfer.
                let words = [command, number, 0, u32::from(is_in), endpoint];
                let rest = if command == UNLINK { [room % 30, 0] } else { [0, length] };
                let mut bytes: Vec<u8> =
                    words.iter().chain(&rest).chain(&[0; 3]).flat_map(|word| word.to_be_bytes()).collect();
                bytes.extend(setup);
                bytes.extend(if is_out { data } else { Vec::new() });
                bytes
            },
        )
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(256))]

        /// Every transfer is answered at most once, and the device becomes idle after each message.
        #[test]
        fn for_any_messages_of_a_host_no_transfer_is_answered_twice(sent in proptest::collection::vec(messages(), 0..60)) {
            let bus = UsbBusAllocator::new(Bus::default());
            let mut class = WheelClass::new(&bus);
            let mut device = WheelClass::device(&bus).unwrap();
            let (mut next, mut open) = (1000_u32, BTreeMap::new());
            for mut message in sent {
                // Numbers are the host's own count.
                next += 1;
                message[4..8].copy_from_slice(&next.to_be_bytes());
                let (header, data) = message.split_first_chunk::<HEADER>().unwrap();
                prop_assert_eq!(data_length(header), Ok(data.len()));
                let is_in = word(header, 0) == SUBMIT && word(header, 12) != 0;
                open.insert(next, if is_in { word(header, 24) } else { 0 });
                device.bus().receive(header, data).unwrap();
                let polls = (0..1000).take_while(|_| device.poll(&mut [&mut class])).count();
                prop_assert!(polls < 1000, "the device does not come to rest");
                let mut answers = &device.bus().answers()[..];
                while let Some((header, rest)) = answers.split_first_chunk::<HEADER>() {
                    let room = open.remove(&word(header, 4));
                    prop_assert!(room.is_some(), "answered twice: {}", word(header, 4));
                    // Data of a transfer from the device follows, within the room that the host has.
                    let follows = if room > Some(0) { word(header, 24) } else { 0 };
                    prop_assert!(Some(follows) <= room);
                    let (_, after) = rest.split_at_checked(follows as usize).unwrap();
                    answers = after;
                }
            }
        }

        #[test]
        fn malformed_messages_are_refused(bytes in any::<[u8; HEADER]>()) {
            let command = u32::from_be_bytes(bytes[..4].try_into().unwrap());
            prop_assert_eq!(data_length(&bytes).is_err(), !(command == SUBMIT || command == UNLINK) || command == SUBMIT && {
                u32::from_be_bytes(bytes[24..28].try_into().unwrap()) > super::MAX_TRANSFER_BYTES as u32
            });
        }
    }
}
