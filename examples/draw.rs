//! Draws a ride as SVG: the field, the planned path, and the bike's outline every second.
//!
//! `cargo run --release --example draw -- scenarios/fig7.toml > fig7.svg`

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::geometry::Point2;
use bikebot::sim::record::{Event, RecordError, Recorder, Shape, Trace};
use bikebot::sim::{RunControl, ScenarioFile, Setup, run};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Keeps what a picture needs beside the trace: the field and the plan.
#[derive(Default)]
struct Picture {
    bounds: [[f64; 2]; 2],
    shapes: Vec<Shape>,
    path: Vec<[f64; 2]>,
    tree: Vec<[[f64; 2]; 2]>,
    outline: Vec<[f64; 2]>,
}

impl Recorder for Picture {
    fn record(
        &mut self,
        _: bikebot::sim::clock::SimTime,
        event: &Event<'_>,
    ) -> Result<(), RecordError> {
        match event {
            Event::Map(map) => {
                self.bounds = map.bounds;
                self.shapes = map.shapes.to_vec();
            }
            Event::Plan(plan) => {
                self.path = plan.path.iter().map(|p| [p.x, p.y]).collect();
                self.tree = plan.tree.to_vec();
            }
            Event::Bike(bike) => self.outline = bike.footprint.clone(),
            _ => {}
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = PathBuf::from(std::env::args().nth(1).ok_or("name a scenario")?);
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    let file = ScenarioFile::parse(&std::fs::read_to_string(&path)?, &[])?;
    let setup = Setup::resolve(&file, &mut |name| {
        std::fs::read(folder.join(name)).map_err(|error| error.to_string())
    })?;
    let mut recorder = (Picture::default(), Trace::default());
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    run(&setup, &mut recorder, control)?;
    println!("{}", svg(&recorder.0, &recorder.1)?);
    Ok(())
}

fn svg(picture: &Picture, trace: &Trace) -> Result<String, Box<dyn std::error::Error>> {
    let column = |name: &str| {
        trace
            .column(name)
            .map(|(_, values)| values)
            .ok_or("not recorded")
    };
    let (x, y, heading, roll) = (
        column("x_m")?,
        column("y_m")?,
        column("heading_rad")?,
        column("roll_rad")?,
    );
    let [[x0, y0], [x1, y1]] = picture.bounds;
    let scale = 640.0 / (x1 - x0).max(y1 - y0).max(1e-9);
    // SVG's y points down.
    let at = |p: [f64; 2]| ((p[0] - x0) * scale, (y1 - p[1]) * scale);
    let line = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        points.map(at).fold(String::new(), |mut text, (x, y)| {
            let _ = write!(text, "{x:.1},{y:.1} ");
            text
        })
    };
    let mut out = String::new();
    writeln!(
        out,
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="-2 -2 {w:.0} {h:.0}" width="{w:.0}" height="{h:.0}">
<rect x="0" y="0" width="{fw:.1}" height="{fh:.1}" fill="#fbfbf8" stroke="#444" stroke-width="2"/>"##,
        w = (x1 - x0) * scale + 4.0,
        h = (y1 - y0) * scale + 4.0,
        fw = (x1 - x0) * scale,
        fh = (y1 - y0) * scale,
    )?;
    for shape in &picture.shapes {
        let polygon: Vec<[f64; 2]> = match shape {
            Shape::Polygon { vertices } => vertices.clone(),
            Shape::Block { min, max } => vec![*min, [max[0], min[1]], *max, [min[0], max[1]]],
            Shape::Disc { center, radius } => {
                let (cx, cy) = at(*center);
                writeln!(
                    out,
                    r##"<circle cx="{cx:.1}" cy="{cy:.1}" r="{:.1}" fill="#5b6770"/>"##,
                    radius * scale
                )?;
                continue;
            }
        };
        writeln!(
            out,
            r##"<polygon points="{}" fill="#5b6770"/>"##,
            line(&mut polygon.into_iter())
        )?;
    }
    for edge in &picture.tree {
        writeln!(
            out,
            r##"<polyline points="{}" fill="none" stroke="#bcd" stroke-width="0.8"/>"##,
            line(&mut edge.iter().copied())
        )?;
    }
    // The outline once a second, darker where the bike leans more.
    for i in (0..x.len()).step_by((1.0 / setup_step(trace)?).round().max(1.0) as usize) {
        let (sin, cos) = heading[i].sin_cos();
        let corners = picture.outline.iter().map(|p| {
            let world = Point2::new(
                x[i] + cos * p[0] - sin * p[1],
                y[i] + sin * p[0] + cos * p[1],
            );
            [world.x, world.y]
        });
        let lean = (roll[i].abs().to_degrees() / 5.0).min(1.0);
        writeln!(
            out,
            r##"<polygon points="{}" fill="#e69f00" fill-opacity="{:.2}" stroke="#b07800" stroke-width="0.8"/>"##,
            line(&mut corners.collect::<Vec<_>>().into_iter()),
            0.12 + 0.4 * lean
        )?;
    }
    writeln!(
        out,
        r##"<polyline points="{}" fill="none" stroke="#0072b2" stroke-width="3"/>"##,
        line(&mut picture.path.iter().copied())
    )?;
    let ridden = x.iter().zip(y).map(|(x, y)| [*x, *y]);
    writeln!(
        out,
        r##"<polyline points="{}" fill="none" stroke="#d55e00" stroke-width="1.6" stroke-dasharray="6 4"/>"##,
        line(&mut ridden.step_by(4))
    )?;
    out.push_str("</svg>");
    Ok(out)
}

/// Time between two recorded states, s.
fn setup_step(trace: &Trace) -> Result<f64, &'static str> {
    let (time, _) = trace.column("x_m").ok_or("not recorded")?;
    match time {
        [first, second, ..] => Ok(second - first),
        _ => Err("nothing was ridden"),
    }
}
