//! Messages in flight: their arrival, and the number that is kept.

use hapt_model::{Source, System};
use hapt_sim::{Channel, Run, uniform};
use hapt_testing::prelude::*;

fn pair(keys: &str, stations: &str, duration: &str) -> System {
    let text = format!(
        "stations = {{ left = {{ world = \"l.toml\"{stations} }}, right = {{ world = \"r.toml\" }} }}\n[[links]]\nkind = \"spring\"\n\
         between = [\"left\", \"right\"]\nstiffness = 0.1\n{keys}\n"
    );
    let mut source = Source::from_text("pair.toml", text);
    let wheel = "loop.period = \"1 ms\"\ndevice = { inertia = 1e-3, damping = 0.05 }\n";
    let hand = "hand = { kind = \"step\", to = 0.5 }";
    source.files.insert("l.toml".into(), format!("{wheel}[scenarios.all]\nduration = \"{duration}\"\n{hand}\n"));
    source.files.insert("r.toml".into(), wheel.into());
    System::read(&source, &[]).unwrap()
}

/// The largest |link| at the right station.
fn felt(network: &System) -> f64 {
    let mut run = Run::new(network, "all").unwrap();
    let mut most = 0.0_f64;
    while let Some(row) = run.next() {
        let row = row.unwrap();
        if row.station == 1 {
            most = most.max(row.link.abs());
        }
    }
    most
}

proptest! {
    #![proptest_config(hapt_testing::cases(200))]

    /// Compared with a list of all messages ever sent, searched at every sample.
    #[test]
    fn a_channel_delivers_each_message_once_from_its_arrival_on_and_keeps_no_other(
        seed in any::<u64>(), delay in 0.0_f64..20.0, more in 0.0_f64..50.0, loss in 0.0_f64..1.0, duplicate in prop_oneof![Just(0.0), 0.0_f64..1.0],
    ) {
        let link = pair("age_max = \"20 ms\"", "", "1 s").links[0].clone();
        let mut channel = Channel::new(&link);
        (channel.delay, channel.loss, channel.duplicate) = ([delay, delay + more], loss, duplicate);
        let (mut random, mut again) = (seed, seed);
        let mut list: Vec<(f64, u32)> = Vec::new();
        for k in 0..300_u32 {
            let now = f64::from(k);
            channel.send(&mut random, now, k);
            let (lost, travel_time) = (uniform(&mut again) < loss, delay + (delay + more - delay) * uniform(&mut again));
            let copied = duplicate > 0.0 && uniform(&mut again) < duplicate;
            if !lost {
                list.push((now + travel_time, k));
                if copied {
                    list.push((now + delay + (delay + more - delay) * uniform(&mut again), k));
                }
            }
            let mut arrived: Vec<u32> = std::iter::from_fn(|| channel.receive(now)).collect();
            let mut expected: Vec<u32> = list.iter().filter(|(due, _)| *due <= now).map(|(_, k)| *k).collect();
            list.retain(|(due, _)| *due > now);
            arrived.sort_unstable();
            expected.sort_unstable();
            prop_assert_eq!(arrived, expected);
            prop_assert_eq!(channel.len(), list.len());
        }
    }

    #[test]
    fn messages_arrive_in_the_order_of_their_arrival_and_together_in_that_of_their_sending(seed in any::<u64>(), even in any::<bool>()) {
        let link = pair("age_max = \"20 ms\"", "", "1 s").links[0].clone();
        let (mut channel, mut random) = (Channel::new(&link), seed);
        channel.delay = [1.0, if even { 1.0 } else { 9.0 }];
        for k in 0..100_u32 {
            channel.send(&mut random, f64::from(k / 10), k);
        }
        let all: Vec<u32> = std::iter::from_fn(|| channel.receive(100.0)).collect();
        prop_assert_eq!(all.len(), 100);
        prop_assert!(!even || all.is_sorted());
        prop_assert!(channel.is_empty());
    }
}

/// Messages of the time before the first sample are not stored, and the cost of those in flight is logarithmic in their number.
#[test]
fn the_largest_phase_and_delay_run_as_any_other() {
    let received = felt(&pair("delay = 5\nage_max = 6", ", phase = 0", "8 s"));
    // The step arrives after the delay. Until then the received position is 0.
    assert!(received > 0.04, "{received}");
    assert_eq!(felt(&pair("delay = 9\ndelay_max = 1000\nage_max = 1000", "", "8 s")), 0.0);
    assert_eq!(felt(&pair("delay = 5\nage_max = 6", ", phase = 1000", "8 s")), 0.0);
    assert!(felt(&pair("delay = 2\ndelay_max = 100\nage_max = 1000", "", "20 s")) > 0.0);
}
