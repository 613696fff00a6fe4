//! Defaults, names of keys, ranges and refusals.

use super::*;

#[test]
fn defaults_make_sense_and_survive_a_round_trip() {
    for params in [
        PlannerParams::default(),
        PlannerParams::table_1(),
        PlannerParams::literal(),
    ] {
        params.check().unwrap();
        params.parse_footprint().unwrap();
        let text = serde_json::to_string(&params).unwrap();
        assert_eq!(
            serde_json::from_str::<PlannerParams>(&text).unwrap(),
            params
        );
    }
}

#[test]
fn keys_carry_their_units() {
    let params: PlannerParams = serde_json::from_str(
        r#"{"method": "birrt_smooth", "max_curvature_per_m": 0.5, "scale_m": 2.0, "goal": "ball"}"#,
    )
    .unwrap();
    assert_eq!(params.method, Method::BirrtSmooth);
    assert_eq!(
        (
            params.max_step(),
            params.corridor_half_width(),
            params.max_curvature
        ),
        (10.0, 4.0, 0.5)
    );
    assert!(serde_json::from_str::<PlannerParams>(r#"{"max_curvature": 0.5}"#).is_err());
}

#[test]
fn every_number_has_a_range_and_every_key_an_explanation() {
    let schema = serde_json::to_value(schemars::schema_for!(PlannerParams)).unwrap();
    for (key, field) in schema["properties"].as_object().unwrap() {
        let says = field["description"]
            .as_str()
            .is_some_and(|text| text.len() > 20);
        assert!(says, "{key}");
        if field["type"] == "number" || field["type"] == "integer" {
            assert!(
                field["minimum"].is_number() && field["maximum"].is_number(),
                "{key}"
            );
        }
    }
}

#[test]
fn names_of_methods_are_those_of_the_files() {
    for method in Method::ALL {
        assert_eq!(serde_json::to_value(method).unwrap(), method.name());
        assert_eq!(method.name().parse::<Method>().unwrap(), method);
    }
    assert!(
        "dijkstra"
            .parse::<Method>()
            .unwrap_err()
            .contains("birrt_smooth")
    );
}

#[test]
fn lengths_that_vanish_or_overflow_once_scaled_are_refused() {
    for scale in [1e-200, 1e200] {
        let params = PlannerParams {
            scale,
            max_step_scales: scale,
            ..PlannerParams::default()
        };
        let error = params.check().unwrap_err();
        assert!(error.to_string().contains("max_step_scales"), "{error}");
    }
    let params = PlannerParams {
        near_limit: 0,
        ..PlannerParams::default()
    };
    assert!(
        params
            .check()
            .unwrap_err()
            .to_string()
            .contains("near_limit")
    );
}

#[test]
fn names_the_number_that_cannot_be_planned_with() {
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let params = PlannerParams {
            scale,
            ..PlannerParams::default()
        };
        let error = params.check().unwrap_err();
        assert!(
            matches!(
                error,
                PlanError::InvalidParameter {
                    name: "scale_m",
                    ..
                }
            ),
            "{error}"
        );
    }
}
