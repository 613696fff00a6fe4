//! What a recording says of its run, before and after.

use std::collections::BTreeMap;

use super::{ResultInfo, RunInfo, SourceFile, sha256_hex};
use crate::closed_loop::RunReport;
use crate::outcome::WALL_CLOCK_METRICS;
use crate::scenario::Override;
use crate::setup::Setup;

impl RunInfo {
    /// Of the run of `setup`, with the changes that were made to its scenario.
    ///
    /// `more` holds `plant`, `mode` and `run_id`: the first digits of a hash over version, seed, scenario and files, so that
    /// the same question has the same name, wherever and whenever it is asked.
    #[must_use]
    pub fn of(setup: &Setup, changes: &[Override]) -> Self {
        let files: Vec<SourceFile> = setup
            .files
            .iter()
            .map(|(name, data)| SourceFile {
                name: name.clone(),
                data: data.clone(),
            })
            .collect();
        let mut identity = format!(
            "{}\n{}\n{}\n",
            crate::VERSION,
            setup.seed,
            sha256_hex(setup.scenario_text.as_bytes())
        );
        for file in &files {
            identity.push_str(&format!("{} {}\n", file.name, sha256_hex(&file.data)));
        }
        let mut run_id = sha256_hex(identity.as_bytes());
        run_id.truncate(16);
        Self {
            version: crate::VERSION.to_owned(),
            scenario: setup.name.clone(),
            scenario_text: setup.scenario_text.clone(),
            seed: setup.seed,
            overrides: changes.iter().map(ToString::to_string).collect(),
            files,
            more: BTreeMap::from([
                ("plant".to_owned(), setup.plant.name().to_owned()),
                ("mode".to_owned(), setup.mode_name().to_owned()),
                ("run_id".to_owned(), run_id),
            ]),
        }
    }
}

impl ResultInfo {
    /// Of a run that has ended; what the clock measured goes to the host's facts.
    #[must_use]
    pub fn of(report: &RunReport) -> Self {
        let (clock, metrics): (BTreeMap<String, f64>, BTreeMap<String, f64>) = report
            .metrics
            .iter()
            .map(|(name, value)| (name.to_owned(), value))
            .partition(|(name, _)| WALL_CLOCK_METRICS.contains(&name.as_str()));
        let mut host: BTreeMap<String, String> = clock
            .into_iter()
            .map(|(name, value)| (name, value.to_string()))
            .collect();
        host.insert("os".into(), std::env::consts::OS.into());
        host.insert("arch".into(), std::env::consts::ARCH.into());
        Self {
            outcome: report.outcome.name().to_owned(),
            reason: report.reason.clone(),
            result_hash: report.result_hash.clone(),
            metrics,
            expect: report
                .expect
                .iter()
                .map(|check| (check.check.clone(), check.ok))
                .collect(),
            host,
        }
    }
}
