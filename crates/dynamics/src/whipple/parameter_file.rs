//! Parameter files in the text formats of the BicycleParameters collection.
//!
//! ```text
//! w = 1.02+/-0.002          # one parameter a line, with or without its standard deviation
//! ```
//! ```text
//! parameterization: benchmark
//! values:
//!     w: 1.02
//! ```
//!
//! `name = value` and `name: value` mean the same. Besides the paper's parameters (`parameterization: benchmark`,
//! the default) a file may give each body by its principal radii of gyration (`principal`), with the rider as a
//! body of its own: D rear frame, P rider, H front frame, R and F wheels; `k.aa` and `k.bb` lie in the plane of the
//! bicycle, `alpha` is the angle from the forward axis down to the axis of `k.aa`. All 25 parameters and `g` must be
//! given, each once; `v`, a speed, may be; whatever else there is, is refused with its line.

use super::from_bike::combined;
use super::params::{FrameBody, PARAMETERS, Parameter, WheelBody, WhippleParams};
use crate::error::DynamicsError;
use std::collections::BTreeMap;

/// How far lengths that say the same twice may differ, m: files round to five digits.
const SAME: f64 = 1e-3;

/// What a parameter file says.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterFile {
    /// The parameters; they have passed [`WhippleParams::check`].
    pub params: WhippleParams,
    /// Symbol and standard deviation, where the file gives one that is not zero, in the order of
    /// [`PARAMETERS`].
    pub deviations: Vec<(&'static str, f64)>,
    /// `v`: the speed the file is about, m/s.
    pub speed: Option<f64>,
}

/// What is wrong with a parameter file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}{message}", line.map(|line| format!("line {line}: ")).unwrap_or_default())]
pub struct ParameterFileError {
    /// Line, from 1; `None` where the file as a whole is at fault.
    pub line: Option<usize>,
    /// What is wrong.
    pub message: String,
    /// What would do.
    pub help: Option<String>,
}

impl ParameterFileError {
    fn at(line: usize, message: impl Into<String>) -> Self {
        Self {
            line: Some(line),
            message: message.into(),
            help: None,
        }
    }

    fn whole(message: impl Into<String>) -> Self {
        Self {
            line: None,
            message: message.into(),
            help: None,
        }
    }

    fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// A value, its standard deviation and the line it stands in.
#[derive(Debug, Clone, Copy)]
struct Entry {
    line: usize,
    value: f64,
    deviation: f64,
}

/// Which set of names a file uses.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Naming {
    #[default]
    Benchmark,
    Principal,
}

/// Names of the principal parameterisation.
const PRINCIPAL: [&str; 46] = [
    "w", "c", "lam", "g", //
    "mD", "xD", "yD", "zD", "kDaa", "kDbb", "kDyy", "alphaD", //
    "mP", "xP", "yP", "zP", "kPaa", "kPbb", "kPyy", "alphaP", "lP", "wP", //
    "mH", "xH", "yH", "zH", "kHaa", "kHbb", "kHyy", "alphaH", //
    "mR", "rR", "xR", "yR", "zR", "kRaa", "kRbb", "kRyy", //
    "mF", "rF", "xF", "yF", "zF", "kFaa", "kFbb", "kFyy",
];
/// Those that say nothing about the motion (the rider's size) or what is known without them.
const PRINCIPAL_OPTIONAL: [&str; 11] = [
    "lP", "wP", "yD", "yP", "yH", "yR", "yF", "xR", "xF", "zR", "zF",
];

impl Naming {
    fn names(self) -> Vec<&'static str> {
        match self {
            Self::Benchmark => PARAMETERS
                .iter()
                .map(|parameter| parameter.symbol)
                .collect(),
            Self::Principal => PRINCIPAL.to_vec(),
        }
    }

    fn is_optional(self, name: &str) -> bool {
        self == Self::Principal && PRINCIPAL_OPTIONAL.contains(&name)
    }
}

impl ParameterFile {
    /// Reads a parameter file.
    ///
    /// # Errors
    ///
    /// [`ParameterFileError`] with the line, for anything that is not as described at the top of this module, and
    /// for a set that no bicycle can have.
    pub fn parse(text: &str) -> Result<Self, ParameterFileError> {
        let (naming, mut entries) = read(text)?;
        let names = naming.names();
        for (name, entry) in &entries {
            if !names.contains(&name.as_str()) && name != "v" {
                return Err(unknown(name, entry.line, naming));
            }
        }
        let missing: Vec<&str> = names
            .into_iter()
            .filter(|name| !entries.contains_key(*name) && !naming.is_optional(name))
            .collect();
        if !missing.is_empty() {
            return Err(match missing.len() {
                count if count == naming.names().len() => {
                    ParameterFileError::whole("the file holds no parameters of a bicycle")
                }
                1 => {
                    ParameterFileError::whole(format!("the parameter `{}` is missing", missing[0]))
                }
                count => ParameterFileError::whole(format!(
                    "{count} parameters are missing: {}",
                    missing.join(", ")
                )),
            }
            .help("a line is a name and a number, such as `w = 1.02` or `w: 1.02`"));
        }
        let speed = entries.remove("v");
        if let Some(entry) = speed
            && entry.value < 0.0
        {
            return Err(ParameterFileError::at(
                entry.line,
                format!(
                    "v = {} m/s must be at least 0: the bicycle rides forwards",
                    entry.value
                ),
            ));
        }
        let (params, deviations) = match naming {
            Naming::Benchmark => (benchmark(&entries)?, deviations(&entries)),
            Naming::Principal => (principal(&entries)?, Vec::new()),
        };
        params
            .check()
            .map_err(|error| impossible(&error, &entries))?;
        Ok(Self {
            params,
            deviations,
            speed: speed.map(|entry| entry.value),
        })
    }
}

/// The lines of a file as names and numbers.
fn read(text: &str) -> Result<(Naming, BTreeMap<String, Entry>), ParameterFileError> {
    let mut naming = Naming::default();
    let mut entries: BTreeMap<String, Entry> = BTreeMap::new();
    // The indent of a key whose text fills the lines below it that are indented more.
    let mut prose: Option<usize> = None;
    for (index, raw) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let line = index + 1;
        let indent = raw.len() - raw.trim_start().len();
        let content = raw.split('#').next().unwrap_or_default().trim();
        if raw.trim().is_empty() || prose.is_some_and(|key| indent > key) {
            continue;
        }
        prose = None;
        if content.is_empty() || content == "---" {
            continue;
        }
        let Some(at) = content.find(['=', ':']) else {
            return Err(ParameterFileError::at(
                line,
                format!("`{}` is not a name and a number", shortened(content)),
            )
            .help("write it as `w = 1.02`, `w = 1.02+/-0.002` or `w: 1.02`"));
        };
        let (name, value) = (content[..at].trim(), content[at + 1..].trim());
        match name {
            "parameterization" => {
                naming = match value {
                    "benchmark" => Naming::Benchmark,
                    "principal" => Naming::Principal,
                    other => {
                        return Err(ParameterFileError::at(
                            line,
                            format!("the parameterization `{}` is not known", shortened(other)),
                        )
                        .help("known are benchmark and principal"));
                    }
                };
            }
            "description" => {
                prose = matches!(value.chars().next(), Some('|' | '>')).then_some(indent)
            }
            // What the set is called, whether a rider sits on it, and the heading of the numbers.
            "parameters" | "rider" => {}
            "values" if value.is_empty() => {}
            _ => {
                let entry = number(name, value, line)?;
                if let Some(before) = entries.insert(name.to_owned(), entry) {
                    return Err(ParameterFileError::at(
                        line,
                        format!(
                            "`{}` was given in line {} already",
                            shortened(name),
                            before.line
                        ),
                    ));
                }
            }
        }
    }
    Ok((naming, entries))
}

/// `1.02`, `1.02+/-0.002` or `1.02 ± 0.002`.
fn number(name: &str, text: &str, line: usize) -> Result<Entry, ParameterFileError> {
    let (value, deviation) = match text.split_once("+/-").or_else(|| text.split_once('±')) {
        Some((value, deviation)) => (value.trim(), Some(deviation.trim())),
        None => (text, None),
    };
    let finite = |text: &str| {
        let parsed = text.parse::<f64>().ok().filter(|number| number.is_finite());
        parsed.ok_or_else(|| {
            let what = if text.is_empty() {
                format!("`{}` has no value", shortened(name))
            } else {
                format!("`{}` is not a finite number", shortened(text))
            };
            ParameterFileError::at(line, what).help("write it as `w = 1.02` or `w = 1.02+/-0.002`")
        })
    };
    let value = finite(value)?;
    let deviation = deviation.map_or(Ok(0.0), finite)?;
    if deviation < 0.0 {
        return Err(ParameterFileError::at(
            line,
            format!("the standard deviation {deviation} is negative"),
        ));
    }
    Ok(Entry {
        line,
        value,
        deviation,
    })
}

fn unknown(name: &str, line: usize, naming: Naming) -> ParameterFileError {
    let error = ParameterFileError::at(
        line,
        format!("`{}` is no parameter of a bicycle", shortened(name)),
    );
    let by_case = |known: &&str| known.eq_ignore_ascii_case(name);
    match naming.names().into_iter().find(by_case) {
        Some(known) => error.help(format!("did you mean `{known}`?")),
        None if Naming::Principal.names().contains(&name) => {
            error.help("it belongs to `parameterization: principal`, which the file does not say")
        }
        None if Parameter::named(name).is_some() => {
            error.help("it belongs to `parameterization: benchmark`")
        }
        None => error.help(format!(
            "known are {}, and v for a speed",
            naming.names().join(", ")
        )),
    }
}

fn benchmark(entries: &BTreeMap<String, Entry>) -> Result<WhippleParams, ParameterFileError> {
    let mut params = WhippleParams::benchmark();
    for parameter in &PARAMETERS {
        (parameter.set)(&mut params, entry(entries, parameter.symbol)?.value);
    }
    Ok(params)
}

/// The standard deviations of the paper's parameters.
fn deviations(entries: &BTreeMap<String, Entry>) -> Vec<(&'static str, f64)> {
    PARAMETERS
        .iter()
        .filter_map(|parameter| {
            let deviation = entries.get(parameter.symbol)?.deviation;
            (deviation > 0.0).then_some((parameter.symbol, deviation))
        })
        .collect()
}

fn entry(entries: &BTreeMap<String, Entry>, name: &str) -> Result<Entry, ParameterFileError> {
    let found = entries.get(name).copied();
    found.ok_or_else(|| ParameterFileError::whole(format!("the parameter `{name}` is missing")))
}

/// Principal radii of gyration to masses and moments; rear frame and rider become one body.
fn principal(entries: &BTreeMap<String, Entry>) -> Result<WhippleParams, ParameterFileError> {
    let value = |name: &str| entry(entries, name).map(|entry| entry.value);
    // What a Whipple bicycle has no place for, or what the file says twice.
    let (w, r_r, r_f) = (value("w")?, value("rR")?, value("rF")?);
    for (name, must, why) in [
        ("yD", 0.0, "the bicycle is symmetric"),
        ("yP", 0.0, "the bicycle is symmetric"),
        ("yH", 0.0, "the bicycle is symmetric"),
        ("yR", 0.0, "the bicycle is symmetric"),
        ("yF", 0.0, "the bicycle is symmetric"),
        ("xR", 0.0, "the rear wheel stands at the origin"),
        ("xF", w, "the front wheel stands at the wheelbase w"),
        ("zR", -r_r, "the rear wheel's centre lies at its radius rR"),
        ("zF", -r_f, "the front wheel's centre lies at its radius rF"),
    ] {
        if let Some(found) = entries.get(name)
            && (found.value - must).abs() > SAME
        {
            return Err(ParameterFileError::at(
                found.line,
                format!("{name} = {} m must be {must} m: {why}", found.value),
            ));
        }
    }
    let mass_of = |body: &str| -> Result<f64, ParameterFileError> {
        let name = format!("m{body}");
        let found = entry(entries, &name)?;
        if found.value < 0.0 {
            return Err(ParameterFileError::at(
                found.line,
                format!(
                    "{name} = {} kg must be at least 0: a mass is not negative",
                    found.value
                ),
            ));
        }
        Ok(found.value)
    };
    let frame = |body: &str| -> Result<FrameBody, ParameterFileError> {
        let of = |what: &str, axis: &str| value(&format!("{what}{body}{axis}"));
        let mass = mass_of(body)?;
        let moment = |axis: &str| of("k", axis).map(|radius| mass * radius * radius);
        let (aa, bb) = (moment("aa")?, moment("bb")?);
        let (sin, cos) = of("alpha", "")?.sin_cos();
        Ok(FrameBody {
            x: of("x", "")?,
            z: of("z", "")?,
            mass,
            ixx: aa * cos * cos + bb * sin * sin,
            iyy: moment("yy")?,
            izz: aa * sin * sin + bb * cos * cos,
            ixz: (bb - aa) * sin * cos,
        })
    };
    let wheel = |body: &str, radius: f64| -> Result<WheelBody, ParameterFileError> {
        let mass = mass_of(body)?;
        let k = |axis: &str| entry(entries, &format!("k{body}{axis}"));
        let (aa, bb) = (k("aa")?, k("bb")?);
        if (aa.value - bb.value).abs() > SAME {
            return Err(ParameterFileError::at(
                bb.line,
                format!(
                    "k{body}bb = {} m must be k{body}aa = {} m: a wheel is round",
                    bb.value, aa.value
                ),
            ));
        }
        Ok(WheelBody {
            radius,
            mass,
            ixx: mass * aa.value * aa.value,
            iyy: mass * k("yy")?.value.powi(2),
        })
    };
    let (rear, rider) = (frame("D")?, frame("P")?);
    let rear_frame = if rider.mass > 0.0 {
        combined(&[(1.0, rear), (1.0, rider)])
    } else {
        rear
    };
    Ok(WhippleParams {
        wheelbase: w,
        trail: value("c")?,
        tilt: value("lam")?,
        gravity: value("g")?,
        rear_wheel: wheel("R", r_r)?,
        rear_frame,
        front_frame: frame("H")?,
        front_wheel: wheel("F", r_f)?,
    })
}

/// A refused set, at the line of the parameter that is to blame where there is one.
fn impossible(error: &DynamicsError, entries: &BTreeMap<String, Entry>) -> ParameterFileError {
    let line = match error {
        DynamicsError::ImpossibleBicycle { what, .. } => {
            let symbol = what.trim_matches('|');
            entries.get(symbol).map(|entry| entry.line)
        }
        _ => None,
    };
    ParameterFileError {
        line,
        message: error.to_string(),
        help: None,
    }
}

/// At most the first 40 characters.
fn shortened(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((at, _)) => format!("{}…", &text[..at]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text_of(params: &WhippleParams, separator: &str) -> String {
        PARAMETERS
            .iter()
            .map(|p| format!("{}{separator}{:?}\n", p.symbol, (p.get)(params)))
            .collect()
    }

    fn refusal(text: &str) -> ParameterFileError {
        ParameterFile::parse(text).expect_err("a bad file")
    }

    #[test]
    fn both_notations_say_the_same() {
        let benchmark = WhippleParams::benchmark();
        let plain = text_of(&benchmark, " = ");
        let yaml = format!(
            "parameterization: benchmark  # symbols\nparameters: mine\nrider: True\ndescription: |\n    Numbers w = 7\n    \
             of mine.\nvalues:\n{}    v: 5.0\n",
            text_of(&benchmark, ": ")
                .lines()
                .map(|line| format!("    {line}\n"))
                .collect::<String>()
        );
        let read = ParameterFile::parse(&plain).unwrap();
        assert_eq!((read.params, read.speed), (benchmark, None));
        let read = ParameterFile::parse(&yaml.replace('\n', "\r\n")).unwrap();
        assert_eq!((read.params, read.speed), (benchmark, Some(5.0)));
        assert!(read.deviations.is_empty());
    }

    #[test]
    fn standard_deviations_are_kept() {
        let text = text_of(&WhippleParams::benchmark(), " = ")
            .replace("w = 1.02\n", "w = 1.02+/-0.002\n")
            .replace("mB = 85.0\n", "mB = 85.0 ± 0.5\n")
            .replace("c = 0.08\n", "c = 0.08 +/- 0.0\n");
        let read = ParameterFile::parse(&text).unwrap();
        assert_eq!(read.deviations, [("w", 0.002), ("mB", 0.5)]);
        assert_eq!(read.params, WhippleParams::benchmark());
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let good = text_of(&WhippleParams::benchmark(), " = ");
        for (text, line, part, help) in [
            (
                good.replace("w = 1.02", "w = wide"),
                Some(1),
                "`wide` is not a finite number",
                "w = 1.02",
            ),
            (
                good.replace("c = 0.08", "c ="),
                Some(2),
                "`c` has no value",
                "w = 1.02",
            ),
            (
                good.replace("c = 0.08", "c = nan"),
                Some(2),
                "`nan` is not a finite",
                "w = 1.02",
            ),
            (
                good.replace("c = 0.08", "c = 0.08+/--1"),
                Some(2),
                "-1 is negative",
                "",
            ),
            (
                good.replace("c = 0.08", "trail 0.08"),
                Some(2),
                "`trail 0.08` is not a name",
                "w = 1.02",
            ),
            (
                good.replace("mB = ", "mb = "),
                Some(11),
                "`mb` is no parameter",
                "did you mean `mB`",
            ),
            (
                format!("{good}kDaa = 1\n"),
                Some(27),
                "`kDaa`",
                "parameterization: principal",
            ),
            (
                format!("{good}w = 1\n"),
                Some(27),
                "`w` was given in line 1 already",
                "",
            ),
            (
                good.replace("mB = 85.0\n", ""),
                None,
                "the parameter `mB` is missing",
                "w = 1.02",
            ),
            (
                "w = 1\nc = 0\n".into(),
                None,
                "24 parameters are missing: lam, g",
                "w = 1.02",
            ),
            (String::new(), None, "holds no parameters", "w = 1.02"),
            (
                "parameterization: moore\n".into(),
                Some(1),
                "`moore` is not known",
                "benchmark and principal",
            ),
            (
                format!("{good}v = -3\n"),
                Some(27),
                "v = -3 m/s must be at least 0",
                "",
            ),
            (
                good.replace("mB = 85.0", "mB = -85"),
                Some(11),
                "mB = -85 kg must be at least 0",
                "",
            ),
            (
                good.replace("IHxz = -0.00756", "IHxz = 0.03"),
                Some(22),
                "|IHxz| = 0.03",
                "",
            ),
        ] {
            let error = refusal(&text);
            assert_eq!(error.line, line, "{error}");
            assert!(error.message.contains(part), "`{part}` is not in: {error}");
            assert!(
                error.help.clone().unwrap_or_default().contains(help),
                "{error:?}"
            );
        }
    }

    #[test]
    fn principal_radii_give_the_moments_they_stand_for() {
        // The benchmark's frames by their principal moments, the rider of no mass.
        let text = "parameterization: principal\nvalues:\n  w: 1.02\n  c: 0.08\n  lam: 0.3141592653589793\n  g: 9.81\n  \
             mD: 85.0\n  xD: 0.3\n  zD: -0.9\n  kDaa: 0.34299717\n  kDbb: 0.15339300\n  kDyy: 0.35973846\n  \
             alphaD: -0.32175055\n  mP: 0.0\n  xP: 0.3\n  zP: -1.0\n  kPaa: 0.3\n  kPbb: 0.1\n  kPyy: 0.3\n  alphaP: 0.0\n  \
             mH: 4.0\n  xH: 0.9\n  zH: -0.7\n  kHaa: 0.12247449\n  kHbb: 0.03872983\n  kHyy: 0.12247449\n  \
             alphaH: 0.14189705\n  rR: 0.3\n  mR: 2.0\n  kRaa: 0.17363755\n  kRbb: 0.17363755\n  kRyy: 0.24494897\n  \
             rF: 0.35\n  mF: 3.0\n  kFaa: 0.21641011\n  kFbb: 0.21641011\n  kFyy: 0.30550505\n";
        let read = ParameterFile::parse(text).unwrap();
        let wanted = WhippleParams::benchmark();
        for parameter in &PARAMETERS {
            let (got, want) = ((parameter.get)(&read.params), (parameter.get)(&wanted));
            // The radii above are printed to eight digits.
            assert!(
                (got - want).abs() < 1e-6,
                "{}: {got}, not {want}",
                parameter.symbol
            );
        }
        let lopsided = text.replace("  mH: 4.0\n", "  mH: 4.0\n  yH: 0.02\n");
        let error = refusal(&lopsided);
        assert_eq!(error.line, Some(22));
        assert!(error.message.contains("yH = 0.02 m must be 0 m"), "{error}");
        let oval = refusal(&text.replace("kFbb: 0.2164", "kFbb: 0.3164"));
        assert!(oval.message.contains("a wheel is round"), "{oval}");
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused_but_never_panics(text in "\\PC*(\n\\PC*){0,4}") {
            let _ = ParameterFile::parse(&text);
        }

        #[test]
        fn a_written_set_is_read_back_bit_for_bit(scale in 0.9_f64..1.1) {
            let mut params = WhippleParams::benchmark();
            params.rear_frame.mass *= scale;
            params.wheelbase *= scale;
            let read = ParameterFile::parse(&text_of(&params, " = ")).unwrap();
            prop_assert_eq!(read.params, params);
        }
    }
}
