//! Frames on a CAN bus as the medium of links.

use std::fmt;
use std::io;
use std::str::FromStr;
use std::time::{Duration, Instant};

use hapt_drive::{Bus, BusAddress, Frame};
use hapt_model::System;
use hapt_rt::LinkPort;
use hapt_wire::link::{Codec, Frames};

use super::ends::{Arrived, Medium};
use super::station::{CanLimit, LinkError, Links, Transport};

/// The longest wait of a frame for room in the send queue, after which it is lost.
const SEND_TIMEOUT: Duration = Duration::from_millis(1);

/// A CAN bus of a network's links: `can:can0`, `can:/dev/ttyACM0@500k`, each with `#RANGE`.
///
/// ```
/// use hapt_host::links::CanAddress;
///
/// let address: CanAddress = "can:can0#17".parse()?;
/// assert_eq!((address.bus.place.as_str(), address.range), ("can0", 17));
/// assert!("can:can0#0".parse::<CanAddress>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanAddress {
    /// The interface, or the adapter on a serial port.
    pub bus: BusAddress,
    /// The range of identifiers that the network has there, of [`Frames::RANGES`].
    pub range: u16,
}

impl FromStr for CanAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let rest =
            text.strip_prefix("can:").ok_or("a CAN bus is can:can0, or can:/dev/ttyACM0 with an slcan adapter")?;
        let (bus, range) = match rest.rsplit_once('#') {
            None => (rest, Frames::RANGE),
            Some((bus, range)) => {
                let ranges = Frames::RANGES;
                let number = range.parse().ok().filter(|number| ranges.contains(number)).ok_or_else(|| {
                    format!(
                        "{range:?} is not a range of identifiers; expected {} to {}; a drive has those below",
                        ranges.start(),
                        ranges.end()
                    )
                })?;
                (bus, number)
            }
        };
        if bus.is_empty() || bus.starts_with('@') {
            return Err("the bus is missing: can:can0, or can:/dev/ttyACM0 with an slcan adapter".into());
        }
        Ok(CanAddress { bus: bus.parse()?, range })
    }
}

impl fmt::Display for CanAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "can:{}#{}", self.bus, self.range)
    }
}

impl CanAddress {
    /// The largest total rate of the links of all stations, in bit/s.
    ///
    /// # Errors
    /// A bus does not carry this network: too many links, too many messages within an `age_max`, or more than the adapter's rate.
    pub fn load(&self, network: &System) -> Result<f64, CanLimit> {
        if network.links.len() > Frames::LINKS {
            return Err(CanLimit::Many { count: network.links.len() });
        }
        let mut sent = 0.0;
        for (link, side) in network.links.iter().flat_map(|link| [(link, 0), (link, 1)]) {
            let [own, other] = [side, 1 - side].map(|side| &network.stations[link.between[side]]);
            let sample = own.world.sampling.period;
            // Where messages are fewer than samples, one may be sent half a sample early.
            let period = link.period.map_or(sample, |period| sample.max(period - 0.5 * sample));
            let most = Frames::UNANSWERED.unwrap_or(u64::MAX);
            if link.age_max / period > most as f64 {
                return Err(CanLimit::Fast {
                    name: other.name.clone(),
                    messages: link.age_max / period,
                    most,
                    period: link.age_max / most as f64 + 0.5 * sample,
                });
            }
            sent += f64::from(Frames::BITS) / period;
        }
        // An adapter opens a bus at its default rate, too.
        let rate = self.bus.is_port().then(|| f64::from(self.bus.rate.unwrap_or_default().bits()));
        match rate {
            Some(rate) if sent > rate => Err(CanLimit::Busy { sent, rate }),
            _ => Ok(sent),
        }
    }
}

/// A bus, and the identifiers of this station's links.
struct Can {
    bus: Box<dyn Bus>,
    links: Vec<Frames>,
}

impl Medium for Can {
    type Codec = Frames;
    type To = ();

    fn receive(&mut self, into: &mut [u8]) -> Arrived {
        let frame = match self.bus.receive(Instant::now()) {
            Ok(Some(frame)) => frame,
            Ok(None) => return Arrived::Nothing,
            Err(_) => return Arrived::Other,
        };
        let is_own = |link: &Frames| link.is_of_link(frame.id);
        if !frame.extended || frame.fd || frame.remote || !self.links.iter().any(is_own) {
            return Arrived::Other;
        }
        let datagram = frame.id.to_le_bytes().into_iter().chain(frame.data().iter().copied());
        Arrived::Message(into.iter_mut().zip(datagram).map(|(place, byte)| *place = byte).count())
    }

    fn send(&mut self, (): (), bytes: &[u8]) {
        if let Some((id, data)) = bytes.split_first_chunk() {
            let frame = Frame::classic(u32::from_le_bytes(*id), data).with_extended(true);
            let _ = self.bus.send(&frame, Instant::now() + SEND_TIMEOUT);
        }
    }
}

impl Links {
    /// Over CAN: links the station of this index with all others, which are on the same bus. The second are the loop's ends.
    ///
    /// # Errors
    /// The bus cannot be opened, or does not carry this network: [`LinkError`].
    pub fn over_can(
        network: &System,
        station: usize,
        address: &CanAddress,
    ) -> Result<(Self, Vec<LinkPort>), LinkError> {
        address.load(network)?;
        let [id, mask] = Frames::filter(address.range);
        let failed = |error: io::Error| LinkError::Bus { address: address.to_string(), error };
        let bus = address.bus.open_for(id, mask).map_err(failed)?;
        let codec = |at, first, number| {
            let count = network.links.len();
            Frames::new(address.range, at, number, first).ok_or(CanLimit::Many { count })
        };
        let own = network.links.iter().enumerate().filter(|(_, link)| link.between.contains(&station));
        let links = own.map(|(at, _)| codec(at, true, 0)).collect::<Result<_, _>>()?;
        let medium = Can { bus, links };
        Links::start(medium, network, station, Transport::Real, |at, first, number| Ok((codec(at, first, number)?, ())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_reads_back_and_a_wrong_one_is_explained() {
        for text in ["can:can0#256", "can:vcan0#1", "can:/dev/ttyACM0@500k#511"] {
            assert_eq!(text.parse::<CanAddress>().unwrap().to_string(), text);
        }
        assert_eq!("can:can0".parse::<CanAddress>().unwrap().range, Frames::RANGE);
        for (text, word) in [
            ("can0", "can:can0"),
            ("can:", "is missing"),
            ("can:#3", "is missing"),
            ("can:@1M", "can:/dev/ttyACM0"),
            ("can:can0#512", "1 to 511"),
            ("can:can0#x", "1 to 511"),
            ("can:can0@500k", "ip link set can0"),
            ("can:/dev/ttyACM0@3M", "250k"),
        ] {
            let message = text.parse::<CanAddress>().unwrap_err();
            assert!(message.contains(word), "{text}: {message}");
        }
    }
}
