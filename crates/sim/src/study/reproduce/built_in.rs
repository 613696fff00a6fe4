//! The scenarios and maps behind the figures, as they are shipped: the study runs from anywhere, and whoever reads its page gets them beside it.

/// A shipped file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuiltIn {
    /// Its name from the root of the repository, with `/` between folders.
    pub path: &'static str,
    /// Its content.
    pub text: &'static str,
}

macro_rules! shipped {
    ($($path:literal),+ $(,)?) => {
        /// Every file that the study uses; scenarios name their maps relative to themselves.
        pub const FILES: &[BuiltIn] = &[$(BuiltIn {
            path: concat!("scenarios/", $path),
            text: include_str!(concat!("../../../../../scenarios/", $path)),
        }),+];
    };
}

shipped![
    "balance-recover.toml",
    "fig7-balancer.toml",
    "fig7.toml",
    "maps/fig6.json",
    "maps/fig7-ride.json",
    "planning/fig6-as-printed.toml",
    "planning/fig6.toml",
    "unknown-yard.toml",
];

/// The content of the file of that name.
///
/// # Errors
///
/// The name, where none is shipped under it.
pub fn text(path: &str) -> Result<&'static str, String> {
    let found = FILES.iter().find(|file| file.path == path);
    found
        .map(|file| file.text)
        .ok_or_else(|| format!("{path} is not among the shipped files"))
}

/// The file that `scenario` calls `name`.
///
/// # Errors
///
/// What is not there.
pub fn named_in(scenario: &str, name: &str) -> Result<Vec<u8>, String> {
    let mut folders: Vec<&str> = scenario.split('/').collect();
    folders.pop();
    for part in name.split('/') {
        if part == ".." {
            folders.pop();
        } else {
            folders.push(part);
        }
    }
    text(&folders.join("/")).map(|text| text.as_bytes().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ScenarioFile, Setup};

    #[test]
    fn every_scenario_finds_its_map_among_the_files() {
        for file in FILES.iter().filter(|file| file.path.ends_with(".toml")) {
            let scenario = ScenarioFile::parse(file.text, &[]).unwrap();
            Setup::resolve(&scenario, &mut |name| named_in(file.path, name))
                .unwrap_or_else(|error| panic!("{}: {error}", file.path));
        }
        assert!(named_in("scenarios/fig7.toml", "../../etc/passwd").is_err());
    }
}
