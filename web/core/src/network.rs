//! All stations of a network on one page.

use std::sync::Arc;
use std::time::Duration;

use hapt_analysis::{Linked, StationFindings, check_links};
use hapt_host::links::SteppedLinks;
use hapt_host::messages::NetworkFile;
use hapt_host::simulated_network::SimulatedNetwork;
use hapt_host::{Machine, WorldConfig, rule};
use hapt_model::System;
use hapt_rt::Outside;

use crate::page::{ASLEEP, Page};

/// The longest time that is caught up at once; the loops do not run through a longer pause.
const MAX_CATCH_UP: Duration = Duration::from_millis(100);

/// The stations of a network, each with the messages to its wheel on the page, and the messages between them.
pub struct NetworkPage {
    stations: Vec<Page>,
    /// With their clocks.
    network: System,
    links: SteppedLinks,
    /// The interval at which messages are passed on: several times in the shortest period.
    slice: Duration,
    /// The network's time, and the last instant of the caller's clock.
    time: Duration,
    now: Option<Duration>,
}

fn verdict(network: &System, findings: &[StationFindings]) -> Linked {
    check_links(network, findings).unwrap_or_else(|error| Linked::refused(&error.to_string()))
}

impl NetworkPage {
    /// The network of a [`NetworkFile`] in JSON, every station armed.
    ///
    /// # Errors
    /// In a sentence: the text is no network, or a station cannot run in a page.
    pub fn new(network: &str) -> Result<Self, String> {
        let file: NetworkFile = serde_json::from_str(network).map_err(|error| error.to_string())?;
        let network = file.network()?;
        let findings = file.alone;
        let periods = network.stations.iter().map(|station| station.world.sampling.period);
        let slice = (0.125 * periods.fold(f64::INFINITY, f64::min)).clamp(50e-6, 500e-6);
        let configs: Vec<(String, WorldConfig)> = (network.stations.iter())
            .map(|station| {
                let config = WorldConfig::checked(station.source.clone(), station.sets.clone(), rule::check)?;
                Ok((station.name.clone(), config))
            })
            .collect::<Result<_, String>>()?;
        let (links, ports) = SteppedLinks::new(&network);
        let first = verdict(&network, &findings);
        let (shared, ports) = SimulatedNetwork::new(network.clone(), first, links.channels(), ports);
        let shared = Arc::new(shared);
        let mut stations = Vec::new();
        for (at, ((name, config), ports)) in configs.into_iter().zip(ports).enumerate() {
            let (to, findings) = (Arc::clone(&shared), findings.clone());
            let view = shared.view(at, links.status(at), move |question| {
                to.answer(&question, verdict(&question.network, &findings));
            });
            let machine = Machine::stepped(&config.world).with_outside(Outside::linked(ports));
            let machine = machine.ok_or_else(|| format!("{name} does not run in a page"))?;
            stations.push(Page::on(config, Machine { network: Some(view), ..machine })?);
        }
        let slice = Duration::from_secs_f64(slice);
        Ok(NetworkPage { stations, network, links, slice, time: Duration::ZERO, now: None })
    }

    /// A station by its index.
    pub fn station(&mut self, index: usize) -> Option<&mut Page> {
        self.stations.get_mut(index)
    }

    /// Takes the samples of all stations that are due at `now`, the time since any instant that stays the same, and passes their messages on; then
    /// telemetry and status, where they are due.
    pub fn poll(&mut self, now: Duration) {
        let pause = now.saturating_sub(self.now.replace(now).unwrap_or(now));
        if pause > ASLEEP {
            self.stations.iter_mut().for_each(Page::release);
        }
        let until = self.time + pause.min(MAX_CATCH_UP);
        loop {
            let time = u64::try_from(self.time.as_nanos()).unwrap_or(u64::MAX);
            for (page, station) in self.stations.iter_mut().zip(&self.network.stations) {
                station.shown(time).into_iter().for_each(|shown| page.advance(Duration::from_nanos(shown)));
            }
            self.links.carry(time);
            if self.time >= until {
                break;
            }
            self.time = (self.time + self.slice).min(until);
        }
        self.stations.iter_mut().for_each(Page::show);
    }
}
