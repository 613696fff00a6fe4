//! The pages, made of a study with one run, and their figures.

use super::*;
use crate::{png, svg};
use bikebot_sim::record::sha256_hex;
use bikebot_sim::study::reproduce::{ReproduceStudy, judge};
use std::sync::OnceLock;

struct Study {
    measured: Measured,
    judged: Vec<Judged>,
    material: Material,
}

fn made() -> Study {
    let study = ReproduceStudy {
        runs: 1,
        rides: 1,
        seed: 1,
        jobs: 2,
        clock: &|| 0.0,
        stop: &|| false,
    };
    let (measured, material) = study.measure(&mut |_| {}).unwrap().unwrap();
    Study {
        judged: judge(&measured),
        measured,
        material,
    }
}

/// Made once for all tests here.
fn study() -> &'static Study {
    static STUDY: OnceLock<Study> = OnceLock::new();
    STUDY.get_or_init(made)
}

fn reproduction(study: &Study) -> Reproduction<'_> {
    Reproduction {
        measured: &study.measured,
        judged: &study.judged,
        material: &study.material,
        again: "bikebot reproduce",
        version: "0.0.0",
    }
}

#[test]
fn figures_are_the_same_bytes_for_the_same_seed() {
    let first = reproduction(study()).figures().unwrap();
    let second = made();
    let second = reproduction(&second).figures().unwrap();
    let names: Vec<_> = first.iter().map(|figure| figure.name).collect();
    assert_eq!(names, ["fig5", "fig6", "fig7", "fig8"]);
    // Sines of another platform may differ in their last bit.
    if cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        let kept = first.iter().map(|figure| {
            let picture = svg::write(&figure.drawing);
            format!(
                "{} {:7} {}.svg\n",
                sha256_hex(picture.as_bytes()),
                picture.len(),
                figure.name
            )
        });
        let kept: String = kept.collect();
        // `bikebot reproduce --runs 1` makes them to be looked at.
        crate::golden::assert_is_as_kept(&kept, "paper.txt");
    }
    for (first, second) in first.iter().zip(&second) {
        let [a, b] = [first, second].map(|figure| svg::write(&figure.drawing));
        assert!(a == b, "{} differs", first.name);
        assert!(!a.contains("NaN"), "{}", first.name);
        let area = first.drawing.extent().unwrap();
        assert!(
            area.left >= -1e-6 && area.right() <= first.drawing.width + 1e-6,
            "{}: {area:?}",
            first.name
        );
        assert!(png::write(&first.drawing, 1.0).unwrap().len() > 10_000);
    }
}

#[test]
fn every_claim_stands_on_both_pages_with_its_command() {
    let it = reproduction(study());
    let figures = it.figures().unwrap();
    let (html, markdown) = (it.html(&figures), it.markdown(&figures));
    for judged in it.judged {
        assert!(html.contains(&format!("<tr id=\"{}\"", judged.id)));
        assert!(markdown.contains(judged.claim), "{}", judged.id);
        let command = crate::page::escaped(&judged.command);
        assert!(html.contains(&command) && markdown.contains(&judged.command));
    }
    assert!(html.contains("reconstruction") && markdown.contains("reconstruction"));
    assert!(html.contains(&it.sentence()) && markdown.contains(&it.sentence()));
    for figure in &figures {
        assert!(html.contains(&format!("<section id=\"{}\"", figure.name)));
        assert!(markdown.contains(&format!("({}.svg)", figure.name)));
    }
}

#[test]
fn the_page_asks_the_network_for_nothing_and_is_as_dark_as_the_reader_likes() {
    let it = reproduction(study());
    let html = it.html(&it.figures().unwrap());
    assert!(html.contains("default-src 'none'") && !html.contains("<script"));
    for word in ["src=\"http", "href=\"http", "url(http", "@import"] {
        assert!(!html.contains(word), "{word}");
    }
    // Pictures take the page's colours, and none of their own that are dark on dark.
    assert!(html.contains("fill=\"var(--paper)\"") && !html.contains("\"#ffffff\""));
    assert!(html.len() < 3_000_000, "{}", html.len());
}

#[test]
fn a_claim_that_fails_makes_a_page_that_fails() {
    // One run by a clock that stands does not show what means do: all others shall hold here.
    let mut judged = study().judged.clone();
    for judged in &mut judged {
        judged.verdict = Verdict::Holds;
    }
    let whole = Reproduction {
        judged: &judged,
        ..reproduction(study())
    };
    assert!(whole.sentence().ends_with("claims hold, none fails"));
    assert!(whole.html(&[]).contains("class=\"verdict good\""));
    let mut judged = judged.clone();
    judged[0].verdict = Verdict::Fails;
    let it = Reproduction {
        judged: &judged,
        ..reproduction(study())
    };
    assert!(it.sentence().ends_with("1 fails"), "{}", it.sentence());
    let html = it.html(&[]);
    assert!(html.contains("class=\"verdict bad\"") && html.contains("✕</b> fails"));
}
