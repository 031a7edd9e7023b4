//! `fuzz TARGET [--runs N] [--seed N] [--keep N]`: runs a fuzz target over mutated inputs of its corpus.
//!
//! Prints every finding with its input at once, and what came of them at the end; `--keep` adds up to so many of the inputs that
//! showed something new to the corpus. Exit status 1 when something was found.

use contactd_tests::fuzz::{Campaign, TARGETS};
use std::path::Path;

fn main() -> Result<(), String> {
    let mut arguments = std::env::args().skip(1);
    let names = TARGETS.map(|t| t.name).join(", ");
    let name = arguments.next().ok_or_else(|| format!("expected a target: {names}"))?;
    let target =
        TARGETS.iter().find(|t| t.name == name).ok_or_else(|| format!("expected one of {names}, found {name:?}"))?;
    let (mut runs, mut seed, mut keep) = (1_000_000, 1, 0);
    while let Some(option) = arguments.next() {
        let number = arguments.next().and_then(|n| n.parse::<u64>().ok());
        let number = number.ok_or_else(|| format!("expected a number after {option}"))?;
        match option.as_str() {
            "--runs" => runs = number,
            "--seed" => seed = number,
            "--keep" => keep = number as usize,
            _ => return Err(format!("expected --runs, --seed or --keep, found {option:?}")),
        }
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target.name);
    let corpus = contactd_tests::fuzz::corpus(target);
    // Findings are told below; the panic's own text would drown them.
    std::panic::set_hook(Box::new(|_| {}));
    let mut campaign = Campaign::new(target, &corpus, seed);
    let mut reported = 0;
    while campaign.runs < runs {
        campaign.step();
        // At once: a run that is cut short has told what it found.
        for finding in &campaign.findings[reported..] {
            let hex: String = finding.input.iter().map(|b| format!("{b:02x}")).collect();
            println!("FOUND after {} runs: {}\n  input {hex}", campaign.runs, finding.what);
        }
        reported = campaign.findings.len();
        if campaign.runs.is_multiple_of(100_000) {
            eprintln!(
                "{name}: {} runs, {} new, {} found",
                campaign.runs,
                campaign.fresh.len(),
                campaign.findings.len()
            );
        }
    }
    println!("{name}: {} runs, {} of them with the slow checks", campaign.runs, campaign.thorough);
    for (word, count) in &campaign.shares {
        println!("  {word}: {count}");
    }
    for input in campaign.fresh.iter().take(keep) {
        let file = folder.join(format!("{:016x}", contactd_tests::fuzz::digest(input)));
        std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&file, input)).map_err(|e| e.to_string())?;
    }
    if campaign.findings.is_empty() { Ok(()) } else { Err(format!("{} findings", campaign.findings.len())) }
}
