//! The verdict of a soak in one line and on one page: whether it may be trusted, and the reasons.

use super::model::{CheckResult, Segment, Soak};
use std::fmt::Write;

/// Most failed checks that the one line names.
const NAMED: usize = 4;
/// Most characters of each that it quotes; soak.md has all of them.
const QUOTED: usize = 120;

/// Whether the soak may be trusted, and the line with the reasons.
pub(super) fn of(soak: &Soak) -> (bool, String) {
    let totals = &soak.totals;
    if totals.segments == 0 {
        return (false, "may not be trusted: no segment has finished yet".into());
    }
    let broken: Vec<_> = soak.segments.iter().flat_map(named_broken).collect();
    if !broken.is_empty() {
        let more = broken.len().saturating_sub(NAMED);
        let more = if more > 0 { format!("; and {more} more, see soak.md") } else { String::new() };
        let first: Vec<_> = broken.iter().take(NAMED).map(|line| quoted(line)).collect();
        let first = first.join("; ");
        let of = format!("{} of {} segments failed", totals.failed, totals.segments);
        return (false, format!("may not be trusted: {of}: {first}{more}"));
    }
    let lost = totals.lost_on_wire + totals.lost_at_queue;
    let mut line = format!(
        "may be trusted: {} segments in {:.1} min, {} frames sent, every one of {} receptions accounted for ({lost} lost, {} of \
         them on purpose, by counts and by gaps alike)",
        totals.segments,
        soak.elapsed_s / 60.0,
        totals.frames_sent,
        totals.frames_due,
        totals.lost_on_wire,
    );
    let judged = |name: &str| {
        let of_name = |segment: &&Segment| {
            segment.checks.iter().any(|check| check.name == name && check.result == CheckResult::Passed)
        };
        soak.segments.iter().filter(of_name).count()
    };
    let _ =
        write!(line, ", memory flat in {}, positions in bounds in {}", judged("memory"), judged("positions"));
    let _ = write!(line, "; {} of {} cycles came late and were skipped", totals.skipped, totals.cycles);
    if let Some(why) = &soak.load_missing_because {
        let _ = write!(line, "; without a load generator: {why}");
    }
    if totals.unfinished > 0 {
        let _ = write!(line, "; {} segments were cut off and not counted", totals.unfinished);
    }
    if soak.elapsed_s < 0.95 * soak.planned_s {
        let _ =
            write!(line, "; so far {:.0} % of the time asked for", 100.0 * soak.elapsed_s / soak.planned_s);
    }
    (true, line)
}

fn quoted(line: &str) -> String {
    match line.char_indices().nth(QUOTED) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line.to_owned(),
    }
}

fn named_broken(segment: &Segment) -> Vec<String> {
    segment.broken().map(|check| format!("{} {}: {}", segment.folder, check.name, check.detail)).collect()
}

pub(super) fn page(soak: &Soak) -> String {
    let mut page = format!("# Soak\n\n**{}**\n\n", soak.verdict);
    let settings = &soak.settings;
    let _ = writeln!(page, "- bus: `{}`", settings.bus);
    let _ = writeln!(page, "- experiments: {}", settings.experiments.join(", "));
    let _ = writeln!(page, "- load generator: {}", settings.load.as_deref().unwrap_or("none"));
    let _ = writeln!(page, "- time: {:.1} of {:.1} min", soak.elapsed_s / 60.0, soak.planned_s / 60.0);
    let ended = soak.ended_because.as_deref().unwrap_or("still running, or killed");
    let _ = writeln!(page, "- ended because: {ended}");
    let _ = writeln!(page, "- files: {:.0} MB\n", soak.folder_bytes as f64 * 1e-6);
    page.push_str("| distribution | p50 us | p99 us | p99.9 us | p99.99 us | max us | samples |\n");
    page.push_str("|---|--:|--:|--:|--:|--:|--:|\n");
    for (tag, kept) in &soak.distributions {
        let [p50, p99, p999, p9999, max] =
            [kept.p50_ns, kept.p99_ns, kept.p999_ns, kept.p9999_ns, kept.max_ns]
                .map(|ns| format!("{:.1}", ns as f64 * 1e-3));
        let _ = writeln!(page, "| {tag} | {p50} | {p99} | {p999} | {p9999} | {max} | {} |", kept.count);
    }
    page.push_str(
        "\n| segment | how | s | result | skipped | stale | lost on purpose | lost at queues | error mm |\n",
    );
    page.push_str("|---|---|--:|---|--:|--:|--:|--:|--:|\n");
    soak.segments.iter().for_each(|segment| page.push_str(&row(segment)));
    let broken: Vec<_> = soak.segments.iter().flat_map(named_broken).collect();
    if !broken.is_empty() {
        page.push_str("\n## What is broken\n\n");
        broken.iter().for_each(|line| page.push_str(&format!("- {line}\n")));
    }
    page
}

fn row(segment: &Segment) -> String {
    let figure = |figure: Option<u64>| figure.map_or("-".into(), |figure| figure.to_string());
    let sum = |part: fn(&super::account::Row) -> u64| segment.account.iter().map(part).sum::<u64>();
    let result = match (segment.finished, segment.failed()) {
        (false, _) => "cut off",
        (_, true) => "**failed**",
        _ => "good",
    };
    let error = segment.figures.position_error_dynamic_m.map_or("-".into(), |m| format!("{:.2}", m * 1e3));
    format!(
        "| {} | {} | {:.0} | {result} | {} | {} | {} | {} | {error} |\n",
        segment.folder,
        segment.spec.description(),
        segment.length_s,
        figure(segment.figures.skipped),
        figure(segment.figures.stale_commands),
        sum(|row| row.lost_on_wire),
        sum(|row| row.lost_at_queue),
    )
}

#[cfg(test)]
mod tests {
    use super::super::model::Totals;
    use super::super::tests::segment;
    use super::*;

    fn soak(segments: Vec<Segment>) -> Soak {
        let totals = Totals::of(&segments);
        Soak { totals, segments, planned_s: 60.0, elapsed_s: 60.0, ..Soak::default() }
    }

    #[test]
    fn one_broken_check_takes_the_trust_away_and_is_named() {
        let good = segment(1, &[("account", CheckResult::Passed), ("memory", CheckResult::Skipped)]);
        let (trusted, line) = of(&soak(vec![good.clone()]));
        assert!(trusted && line.starts_with("may be trusted: 1 segments in 1.0 min"), "{line}");
        let (trusted, line) = of(&soak(vec![good, segment(2, &[("account", CheckResult::Failed)])]));
        assert!(!trusted && line.contains("1 of 2 segments failed: 0002-e account: because"), "{line}");
        let mut long = segment(1, &[("account", CheckResult::Failed)]);
        long.checks[0].detail = "±".repeat(1000);
        assert!(of(&soak(vec![long])).1.chars().count() < 250);
    }

    #[test]
    fn nothing_finished_is_nothing_to_trust() {
        let mut cut_off = segment(1, &[]);
        cut_off.finished = false;
        assert!(!of(&soak(vec![cut_off.clone()])).0);
        let (trusted, line) = of(&soak(vec![cut_off, segment(2, &[("account", CheckResult::Passed)])]));
        assert!(trusted && line.contains("1 segments were cut off"), "{line}");
    }

    #[test]
    fn the_page_has_a_row_for_each_segment() {
        let page = page(&soak(vec![segment(1, &[]), segment(2, &[("gaps", CheckResult::Failed)])]));
        assert!(page.contains("| 0001-e |") && page.contains("- 0002-e gaps: because"), "{page}");
    }
}
