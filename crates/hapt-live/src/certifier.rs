//! The certificate, on its own threads; the results go to the session as events.
//!
//! A newer request replaces an older one. One thread computes the verdict, so that it comes quickly; another computes critical periods,
//! remedies and certified ranges, which take hundreds of certificates, and gives up when the world changes.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use hapt_analysis::{Check, Proposal, Remedy, Verdict, check, is_certified, quick_check};
use hapt_host::messages::{RemedyInfo, Sentence, ServerMessage, VerdictMessage};
use hapt_host::{SettableKey, WorldConfig};
use hapt_model::World;

/// The number of values of a slider that are tried before the edges are refined.
const PLACES: usize = 33;
/// The verdict where the analysis panics; the server continues.
pub(crate) const BROKEN: &str = "the analysis has panicked, a defect of hapt";
/// The nice values of the threads: the verdict of a newer world does not wait for the ranges of an older one.
pub(crate) const VERDICTS: i32 = 5;
const RANGES: i32 = 15;
/// The accuracy of an edge, as a part of the slider.
const WIDTH: f64 = 1e-3;

/// The threads. Dropped, they finish what they compute, and end.
pub struct Certifier {
    requested: Arc<Latest<WorldConfig>>,
    next: Arc<Latest<WorldConfig>>,
    focus: Arc<Mutex<Option<String>>>,
}

/// Passes on a result with its generation; `false`: the session has ended.
type Publish = Arc<dyn Fn(u32, ServerMessage) -> bool + Send + Sync>;

impl Certifier {
    /// Starts the threads; `publish` receives the answers with their generation.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(publish: impl Fn(u32, ServerMessage) -> bool + Send + Sync + 'static) -> std::io::Result<Self> {
        let certifier = Certifier { requested: Arc::default(), next: Arc::default(), focus: Arc::default() };
        let publish: Publish = Arc::new(publish);
        let (requested, next, to) =
            (Arc::clone(&certifier.requested), Arc::clone(&certifier.next), Arc::clone(&publish));
        std::thread::Builder::new().name("certifier".into()).spawn(move || {
            lower_priority(VERDICTS);
            while let Some(config) = requested.take() {
                let (verdict, check) = verdict(&config, quick_check);
                if !to(config.generation, ServerMessage::Verdict(verdict)) {
                    break;
                }
                if check.is_some() {
                    next.put(config);
                }
            }
        })?;
        let (next, focus) = (Arc::clone(&certifier.next), Arc::clone(&certifier.focus));
        std::thread::Builder::new().name("remedies".into()).spawn(move || {
            lower_priority(RANGES);
            while let Some(config) = next.take() {
                if remedies_and_ranges(&config, &next, &focus, &publish).is_none() {
                    break;
                }
            }
        })?;
        Ok(certifier)
    }

    /// Requests the certificate of a world, in place of any earlier request.
    pub fn ask(&self, config: WorldConfig) {
        self.requested.put(config);
    }

    /// Sets the key whose range is computed first.
    pub fn focus(&self, key: String) {
        *self.focus.lock().unwrap_or_else(PoisonError::into_inner) = Some(key);
    }
}

impl Drop for Certifier {
    fn drop(&mut self) {
        self.requested.end();
        self.next.end();
    }
}

/// Lowers the thread's priority below the loop's: a verdict may come late, a sample may not.
pub(crate) fn lower_priority(_by: i32) {
    #[cfg(target_os = "linux")]
    let _ = rustix::process::nice(_by);
}

/// A place for one value; a newer one replaces it.
pub(crate) struct Latest<T> {
    /// The value, and whether no more will come.
    slot: Mutex<(Option<T>, bool)>,
    changed: Condvar,
}

impl<T> Default for Latest<T> {
    fn default() -> Self {
        Latest { slot: Mutex::new((None, false)), changed: Condvar::new() }
    }
}

impl<T> Latest<T> {
    fn slot(&self) -> MutexGuard<'_, (Option<T>, bool)> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Replaces the waiting value.
    pub fn put(&self, value: T) {
        self.slot().0 = Some(value);
        self.changed.notify_one();
    }

    /// No more will come.
    pub fn end(&self) {
        *self.slot() = (None, true);
        self.changed.notify_one();
    }

    /// Whether there is a newer value, or the end.
    fn is_outdated(&self) -> bool {
        let slot = self.slot();
        slot.0.is_some() || slot.1
    }

    /// Waits; `None` at the end.
    pub fn take(&self) -> Option<T> {
        let waiting = |slot: &mut (Option<T>, bool)| slot.0.is_none() && !slot.1;
        self.changed.wait_while(self.slot(), waiting).unwrap_or_else(PoisonError::into_inner).0.take()
    }
}

/// The certificate by `certify`, and the verdict for the page.
fn verdict(
    config: &WorldConfig,
    certify: fn(&World) -> Result<Check, hapt_analysis::Error>,
) -> (Box<VerdictMessage>, Option<Check>) {
    let begin = Instant::now();
    let checked = catch_unwind(|| certify(&config.certified_world()));
    let ms = Some(begin.elapsed().as_secs_f64() * 1e3);
    let checked =
        checked.map_or_else(|_| Err(BROKEN.to_string()), |checked| checked.map_err(|error| error.to_string()));
    match checked {
        Ok(check) => (Box::new(VerdictMessage { ms, ..to_verdict(config, &check) }), Some(check)),
        Err(error) => {
            let sentence = format!("not certified: {error}");
            (Box::new(VerdictMessage { sentence, remedies: Some(Vec::new()), ms, ..empty_verdict(config) }), None)
        }
    }
}

/// An empty verdict.
fn empty_verdict(config: &WorldConfig) -> VerdictMessage {
    VerdictMessage {
        generation: config.generation,
        certified: false,
        sentence: String::new(),
        sentences: Vec::new(),
        growth_per_s: None,
        held_growth_per_s: None,
        free_growth_per_s: None,
        held: Vec::new(),
        free: Vec::new(),
        required_damping: None,
        device_damping: config.certified_world().device.damping,
        notes: Vec::new(),
        remedies: None,
        ms: None,
    }
}

/// The verdict of a certificate, without remedies.
pub(crate) fn to_verdict(config: &WorldConfig, check: &Check) -> VerdictMessage {
    let mut message = empty_verdict(config);
    // An eigenvalue refutes; only a theorem shows that the claim holds.
    let ok = |claim, verdict| match verdict {
        Verdict::Stable => check.claims(claim).then_some(true),
        Verdict::Marginal => None,
        Verdict::Unstable => Some(false),
    };
    // The eigenvalues leave out the device's friction, and some are of slopes that no position has.
    let free = match check.free.verdict {
        Verdict::Unstable if check.claims("free") => Some(true),
        Verdict::Unstable => check.grows_free.then_some(false),
        verdict @ (Verdict::Stable | Verdict::Marginal) => ok("free", verdict),
    };
    let decided = |certified: bool, refuted: bool| (certified || refuted).then_some(certified);
    let sentence = |what, ok, text| Sentence { what, ok, text };
    let passive = &check.passivity;
    message.certified = check.certified.holds();
    message.sentence = check.headline();
    message.sentences = vec![
        sentence("held", ok("held", check.held.verdict), check.sentence()),
        sentence("free", free, check.free_sentence()),
        sentence("passive", decided(passive.is_certified(), passive.is_refuted), check.passivity_sentence()),
    ];
    if let Some(text) = check.uneven_sentence() {
        let ok = decided(check.uneven.is_certified(), check.uneven.is_refuted);
        message.sentences.push(sentence("uneven", ok, text));
    }
    if let Some(text) = check.quantisation_sentence() {
        message.sentences.push(sentence("quantisation", Some(check.quantisation.ok), text));
    }
    message.held_growth_per_s = check.held.growth_per_s;
    message.free_growth_per_s = check.free.growth_per_s;
    message.growth_per_s = [check.held.growth_per_s, check.free.growth_per_s].into_iter().flatten().reduce(f64::max);
    message.held = check.held.eigenvalues.iter().map(|value| [value.re, value.im]).collect();
    message.free = check.free.eigenvalues.iter().map(|value| [value.re, value.im]).collect();
    message.required_damping = passive.required_damping;
    message.notes = passive.not_proved.iter().map(|why| format!("not proved: {why}")).collect();
    message.notes.extend(check.notes.iter().cloned());
    message
}

/// Computes remedies and ranges until a newer world is requested; `None`: the session has ended.
fn remedies_and_ranges(
    config: &WorldConfig,
    next: &Latest<WorldConfig>,
    focus: &Mutex<Option<String>>,
    publish: &Publish,
) -> Option<()> {
    let (mut verdict, check) = verdict(config, check);
    let found = || check.map_or(Vec::new(), |check| remedies(config, &check));
    verdict.remedies = Some(catch_unwind(AssertUnwindSafe(found)).unwrap_or_default());
    let is_open = next.is_outdated() || publish(config.generation, ServerMessage::Verdict(verdict));
    let mut keys: Vec<SettableKey> =
        config.keys().iter().filter(|key| key.kind == "quantity" && !key.fixed).cloned().collect();
    while is_open && !keys.is_empty() {
        let wanted = focus.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let first = keys.iter().position(|key| Some(&key.path) == wanted.as_ref()).unwrap_or(0);
        let key = keys.remove(first);
        let found = catch_unwind(AssertUnwindSafe(|| range(config, &key, &|| next.is_outdated())));
        let Ok(Some(certified)) = found else { continue };
        if next.is_outdated() {
            break;
        }
        let generation = config.generation;
        if !publish(generation, ServerMessage::Range { generation, key: key.path, certified }) {
            return None;
        }
    }
    is_open.then_some(())
}

fn remedies(config: &WorldConfig, check: &Check) -> Vec<RemedyInfo> {
    let world = config.certified_world();
    let found = hapt_analysis::remedies(&world).ok();
    let proposal = found.and_then(|found| {
        hapt_analysis::proposal(&world, config.source(), &config.sets(), check, &found).ok().flatten()
    });
    let mut remedies = proposal.as_ref().map_or(Vec::new(), proposed);
    // Remedies that change the hardware or the file are displayed without a button.
    remedies.iter_mut().filter(|remedy| !config.allows(&remedy.sets)).for_each(|remedy| remedy.sets.clear());
    remedies
}

/// The remedies of a proposal.
pub(crate) fn proposed(proposal: &Proposal) -> Vec<RemedyInfo> {
    let info = |remedy: &Remedy| RemedyInfo { sets: remedy.sets.clone(), text: remedy.lines.join("\n") };
    proposal.remedies.iter().map(info).collect()
}

/// The certified intervals of a key's slider; `None` where `is_over`.
pub(crate) fn range(config: &WorldConfig, key: &SettableKey, is_over: &dyn Fn() -> bool) -> Option<Vec<[f64; 2]>> {
    let at = |part: f64| match key.log {
        true => key.min * (key.max / key.min).powf(part),
        false => key.min + part * (key.max - key.min),
    };
    // Read anew: a compensation follows its share, and the device's number that it compensates. A value that cannot be set is not
    // certified.
    let certified_at = |part: f64| -> Option<bool> {
        let set = || config.with(&key.path, &format!("{:e}", at(part)));
        (!is_over()).then(|| set().is_ok_and(|next| is_certified(&next.certified_world())))
    };
    let mut ranges: Vec<[f64; 2]> = Vec::new();
    let mut before = (0.0, certified_at(0.0)?);
    let mut open = before.1.then_some(0.0);
    for place in 1..PLACES {
        let here = place as f64 / (PLACES - 1) as f64;
        let now = certified_at(here)?;
        if now != before.1 {
            let (mut low, mut high) = (before.0, here);
            while high - low > WIDTH {
                let middle = 0.5 * (low + high);
                if certified_at(middle)? == before.1 { low = middle } else { high = middle }
            }
            // The certified side of the edge.
            match open.take() {
                Some(from) => ranges.push([at(from), at(low)]),
                None => open = Some(high),
            }
        }
        before = (here, now);
    }
    ranges.extend(open.map(|from| [at(from), at(1.0)]));
    Some(ranges)
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use hapt_model::Source;

    use super::*;
    use hapt_testing::WHEEL;

    fn config() -> WorldConfig {
        WorldConfig::new(Source::from_text("wheel.toml", WHEEL), Vec::new()).unwrap()
    }

    #[test]
    fn a_range_ends_where_the_certificate_changes() {
        let config = config();
        let keys = config.keys();
        let stiffness = keys.iter().find(|key| key.path == "couplings.0.stiffness").unwrap();
        let found = range(&config, stiffness, &|| false).unwrap();
        // END requires b >= KT/2 (the energy theorem): one range from the slider's end up to 2b/T.
        let edge = 2.0 * 1.2e-3 / 1e-3;
        assert_eq!(found.len(), 1);
        let [from, to] = found[0];
        assert!(from == stiffness.min && to <= edge * (1.0 + 1e-9) && to > 0.99 * edge, "{found:?} to {edge}");
        assert_eq!(range(&config, stiffness, &|| true), None);
    }

    /// Compensated gravity is a law whose steepest slope, times half a period, is the required damping: b ≥ share G T/2.
    #[test]
    fn the_range_of_a_share_is_what_the_devices_damping_pays_for() {
        let (damping, gravity, period) = (2e-5, 0.1, 1e-3);
        let file = format!(
            "loop.period = {period}\ndevice = {{ inertia = 1e-3, damping = {damping:e}, gravity.torque = {gravity} }}\n\
             [[compensation]]\nof = \"gravity\"\nshare = 0.3\n"
        );
        let config = WorldConfig::new(Source::from_text("lever.toml", file), Vec::new()).unwrap();
        let range_of = |path: &str| {
            let keys = config.keys();
            range(&config, keys.iter().find(|key| key.path == path).unwrap(), &|| false).unwrap()
        };
        let edge = 2.0 * damping / (gravity * period);
        let found = range_of("compensation.0.share");
        assert!(
            matches!(found[..], [[0.0, to]] if to <= edge * (1.0 + 1e-9) && to > 0.99 * edge),
            "{found:?} to {edge}"
        );
        // More gravity is more to take back.
        let edge = 2.0 * damping / (0.3 * period);
        let found = range_of("device.gravity.torque");
        assert!(matches!(found[..], [[_, to]] if to <= edge * (1.0 + 1e-9) && to > 0.99 * edge), "{found:?} to {edge}");
    }

    /// A wall needs more damping than the device has: friction takes the rest up to a speed, and the supervisor may keep that speed.
    #[test]
    fn a_free_wheel_is_good_by_a_theorem_and_bad_by_a_motion_that_grows() {
        let wall = |side: &str, at: &str| {
            format!(
                "[[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nside = \"{side}\"\nat = {at}\nstiffness = 7\n"
            )
        };
        let free = |damping: f64, friction: f64, walls: &str, overspeed: &str| {
            let device = format!("device = {{ inertia = 1e-3, damping = {damping}, friction = {friction} }}\n");
            let file = format!("loop.period = 1e-3\n{device}{overspeed}{walls}");
            let config = WorldConfig::new(Source::from_text("walls.toml", file), Vec::new()).unwrap();
            let check = check(&config.certified_world()).unwrap();
            assert_eq!(check.free.verdict, Verdict::Unstable);
            let verdict = to_verdict(&config, &check);
            (verdict.sentences.iter().find(|sentence| sentence.what == "free").unwrap().ok, verdict.certified)
        };
        let (one, two) = (wall("above", "0.2"), wall("above", "0.2") + &wall("below", "-0.2"));
        let kept = "safety.overspeed = 5\n";
        assert_eq!(free(3e-3, 0.01, &one, kept), (Some(true), true));
        // Enough for either wall, and no position is in both.
        assert_eq!(free(5e-3, 0.01, &two, ""), (None, false));
        assert_eq!(free(3e-3, 0.0, &one, kept), (Some(false), false));
    }

    /// Levant's differentiator is covered by no theorem: eigenvalues that decay show nothing.
    #[test]
    fn a_free_wheel_that_decays_without_a_theorem_is_not_proved() {
        let file = "loop = { period = 1e-3, estimator = \"levant\", acceleration = 500 }\n\
                    device = { inertia = 6.4e-4, damping = 6e-3 }\n\
                    couplings = [{ kind = \"damper\", between = [\"puck\", \"ground\"], damping = 2e-3 }]\n";
        let config = WorldConfig::new(Source::from_text("levant.toml", file), Vec::new()).unwrap();
        let check = check(&config.certified_world()).unwrap();
        assert_eq!(check.free.verdict, Verdict::Stable);
        assert!(
            to_verdict(&config, &check)
                .sentences
                .iter()
                .any(|sentence| sentence.what == "free" && sentence.ok.is_none())
        );
    }

    #[test]
    fn every_remedy_of_keys_makes_the_world_certified_when_they_are_set_together() {
        // A wheel, a wheel with a wall and detents, and one with a bristle: some need one key, some several.
        let many = format!(
            "{WHEEL}{}{}",
            "[[couplings]]\nkind = \"wall\"\nbetween = [\"puck\", \"ground\"]\nside = \"above\"\nat = 0.5\nstiffness = 4\n",
            "[[couplings]]\nkind = \"detent\"\nbetween = [\"puck\", \"ground\"]\ntorque = 0.05\npitch = 0.2\n",
        );
        let bristle = "[[couplings]]\nkind = \"friction\"\nbetween = [\"puck\", \"ground\"]\ncoulomb = 0.01\nstribeck = 0.01\n\
                       stribeck_velocity = 0.1\nbristle_stiffness = 3\nbristle_damping = 0\nviscous = 0\n";
        let (mut one, mut several) = (0, 0);
        for text in [WHEEL.to_string(), many.clone(), format!("{many}{bristle}")] {
            let config = WorldConfig::new(Source::from_text("wheel.toml", text), Vec::new()).unwrap();
            let config = config.with("loop.period", "4 ms").unwrap();
            let (verdict, check) = verdict(&config, check);
            assert!(!verdict.certified && verdict.sentences.iter().any(|sentence| sentence.ok == Some(false)));
            for remedy in remedies(&config, &check.unwrap()) {
                match remedy.sets.len() {
                    0 => continue,
                    1 => one += 1,
                    _ => several += 1,
                }
                let remedied = super::verdict(&config.with_all(&remedy.sets).unwrap(), hapt_analysis::check).0;
                assert!(remedied.certified, "{remedy:?}");
            }
        }
        assert!(one >= 3 && several >= 1, "{one} of one key, {several} of several");
    }

    #[test]
    fn of_several_questions_the_last_is_answered_and_the_end_ends_the_wait() {
        let (to, answers) = channel();
        let certifier = Certifier::start(move |generation, _| to.send(generation).is_ok()).unwrap();
        let mut config = config();
        for _ in 0..20 {
            config = config.reset().unwrap();
            certifier.ask(config.clone());
        }
        // Those in between may be skipped, the last is not, and no other follows it.
        let is_open: Vec<u32> = std::iter::from_fn(|| answers.recv().ok()).take_while(|g| *g != 20).collect();
        assert!(is_open.is_sorted());
        drop(certifier);
        assert!(answers.iter().all(|generation| generation <= 20));
    }
}
