//! The search for twins: tries starts in turn until there are enough twins.
//!
//! A start is refused where a record at the largest noise still distinguishes it from every other effect, where it is hardly
//! detected, or where no experiment distinguishes it from its rival. At most [`MOST_OF_A_PAIR`] twins are of the same pair of
//! effects.

use super::certificate::{ALIKE, APART, in_menu, in_record, probability, with_noise};
use super::rival::{Rival, Screened, Screening};
use super::{Model, Twin, Twins};
use crate::SCHEMA_VERSION;
use crate::compute::{ComputeError, trajectory};
use crate::draws::twins::{Start, start};
use crate::signature::Observer;
use plant::effects::SHEETS;
use plant::{ParameterError, RigParameters};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use record_maker::{Record, simulate};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most twins of the same pair of effects at any places, so that the twins cover many classes.
const MOST_OF_A_PAIR: usize = 5;
/// Largest noise of a record over the specified one.
const MOST_NOISE: f64 = 8.0;
/// Smallest distance from the baseline in the train record. At 7, whose square is twice the gain that the workflow requires of
/// an effect, twins of a development seed with 8 to 16 were not named.
const LEAST_SEEN: f64 = 10.0;
/// Most rivals of a start that are fitted.
const MOST_FITTED: usize = 4;
/// Starts of each effect after which the search ends.
const MOST_ROUNDS: usize = 24;

/// Why a start gives no twin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// Its record needs both axes.
    Linked,
    /// Its record cannot be made, or cannot be compared with the catalogue.
    NoRecord,
    NoRival,
    /// The nearest law of another effect leaves too much, or is outside the drawn range.
    NotAlike,
    /// An observer hardly detects it at the noise that would hide the difference.
    NotSeen,
    NoExperiment,
    Enough,
}

impl Refusal {
    fn reason(self) -> &'static str {
        match self {
            Refusal::Linked => "of linked rods",
            Refusal::NoRecord => "record cannot be made",
            Refusal::NoRival => "no other effect resembles it",
            Refusal::NotAlike => "nearest law of another effect tells itself apart, or is not drawn",
            Refusal::NotSeen => "hardly seen at the noise that makes it alike",
            Refusal::NoExperiment => "no experiment tells the two apart",
            Refusal::Enough => "enough twins of the same pair",
        }
    }
}

/// Searches for `count` twins, `jobs` starts at a time; fewer when the starts are used up or `stop` is set. `say` gets a line
/// for each round.
///
/// # Errors
/// [`ComputeError`] when the thread pool cannot be started.
pub fn search(
    seed: u64,
    count: usize,
    jobs: usize,
    stop: &AtomicBool,
    say: &(dyn Fn(&str) + Sync),
) -> Result<Twins, ComputeError> {
    let pool = ThreadPoolBuilder::new().num_threads(jobs.max(1)).build()?;
    let mut found = Twins {
        schema_version: SCHEMA_VERSION,
        seed,
        starts: 0,
        refused: BTreeMap::new(),
        twins: Vec::new(),
    };
    for round in 0..MOST_ROUNDS {
        if found.twins.len() >= count {
            break;
        }
        let trials = of_round(&pool, seed, round, stop);
        if stop.load(Ordering::Relaxed) {
            break;
        }
        for (number, twin) in trials {
            if found.twins.len() >= count {
                break;
            }
            found.starts = number + 1;
            match twin.and_then(|twin| found.check_pair(twin)) {
                Ok(twin) => found.twins.push(Twin { number: found.twins.len(), ..twin }),
                Err(refusal) => *found.refused.entry(refusal.reason().to_owned()).or_default() += 1,
            }
        }
        say(&format!("{} twins of {} starts", found.twins.len(), found.starts));
    }
    Ok(found)
}

type Trial = (usize, Result<Twin, Refusal>);

/// The starts of all effects once, in their order.
fn of_round(pool: &ThreadPool, seed: u64, round: usize, stop: &AtomicBool) -> Vec<Trial> {
    let numbers = round * SHEETS.len()..(round + 1) * SHEETS.len();
    let twin = |number| twin_of(&start(seed, number).ok_or(Refusal::Linked)?, number);
    let one = |number| (!stop.load(Ordering::Relaxed)).then(|| (number, twin(number)));
    pool.install(|| numbers.into_par_iter().with_max_len(1).filter_map(one).collect())
}

impl Twins {
    /// The twin, unless there are enough of its pair.
    fn check_pair(&self, twin: Twin) -> Result<Twin, Refusal> {
        let pair = |twin: &Twin| {
            let mut pair = [twin.hidden.effect.clone(), twin.rival.effect.clone()];
            pair.sort();
            pair
        };
        let same = self.twins.iter().filter(|other| pair(other) == pair(&twin)).count();
        if same < MOST_OF_A_PAIR { Ok(twin) } else { Err(Refusal::Enough) }
    }
}

/// The twin of a start with the first rival that passes the certificate.
pub(super) fn twin_of(start: &Start, number: usize) -> Result<Twin, Refusal> {
    let (hidden, axis) = (&start.recipe.hidden[0], start.recipe.axis);
    let rig = rig_of(hidden).map_err(|_| Refusal::NoRecord)?;
    let record = simulate(&start.recipe, &RigParameters::baseline()).map_err(|_| Refusal::NoRecord)?;
    let whole = Observer::new(trajectory(&record, &rig));
    let screening = Screening::new(&whole, hidden, axis).ok_or(Refusal::NoRecord)?;
    let mut refusal = Refusal::NoRival;
    for screened in
        screening.all().iter().filter(|screened| screened.distance >= LEAST_SEEN).take(MOST_FITTED)
    {
        let observer = Observer::new(screened.part.of(&record, &rig));
        let Some(rival) = screening.fitted(screened, &observer) else {
            refusal = Refusal::NotAlike;
            continue;
        };
        match of_rival(start, number, (&record, &rig, screened), rival) {
            Ok(twin) => return Ok(twin),
            Err(because) => refusal = because,
        }
    }
    Err(refusal)
}

/// The twin of a start and a fitted law, if it passes the certificate.
fn of_rival(
    start: &Start,
    number: usize,
    (record, rig, screened): (&Record, &RigParameters, &Screened),
    rival: Rival,
) -> Result<Twin, Refusal> {
    let noise = (rival.left / start.distance).max(1.0);
    if noise > MOST_NOISE {
        return Err(Refusal::NotAlike);
    }
    let seen = screened.distance / noise;
    if seen < LEAST_SEEN {
        return Err(Refusal::NotSeen);
    }
    let noisy = |rig: &RigParameters| with_noise(rig, noise).map_err(|_| Refusal::NoRecord);
    let (noisy_rig, noisy_rival) = (noisy(rig)?, noisy(&rival.rig)?);
    let train = in_record(record, screened.part, &noisy_rig, &noisy_rival);
    if probability(train) > ALIKE {
        return Err(Refusal::NotAlike);
    }
    let axis = start.recipe.axis;
    let menu = in_menu([&noisy_rig, &noisy_rival], axis);
    if !menu.values().any(|distance| probability(*distance) >= APART) {
        return Err(Refusal::NoExperiment);
    }
    let hidden = &start.recipe.hidden[0];
    let model = Model {
        effect: hidden.name.to_owned(),
        place: hidden.place.to_string(),
        numbers: hidden.numbers.clone(),
        wrong_parameters: Vec::new(),
    };
    let [hidden, rival] = if start.rival_is_true { [rival.model, model] } else { [model, rival.model] };
    Ok(Twin {
        number: 0,
        start: number,
        recipe_seed: start.recipe.seed,
        axis: axis.name().to_owned(),
        part: screened.part,
        noise,
        hidden,
        rival,
        seen_distance: seen,
        train_distance: train,
        menu_distances: menu,
    })
}

fn rig_of(hidden: &record_maker::Hidden) -> Result<RigParameters, ParameterError> {
    let sheet = plant::effects::sheet(hidden.name).expect("only effects of the catalogue are drawn");
    let numbers: Vec<_> = sheet.keys.iter().map(|key| key.name).zip(hidden.numbers.iter().copied()).collect();
    RigParameters::baseline().with_effect(sheet.name, &hidden.place.to_string(), &numbers)
}
