//! Maps and beliefs as grids.

use foxglove::messages::{Grid, PackedElementField, Vector2, packed_element_field};

use super::super::event::{CellState, GridSample};
use super::{MAP, pose, timestamp, turn, vector};
use crate::clock::SimTime;

/// The map in colour: free light, occupied dark, unknown grey and half clear.
pub(in crate::record) fn map_colour(time: SimTime, map: &GridSample<'_>) -> Grid {
    let data: Vec<u8> = map
        .cells
        .iter()
        .flat_map(|cell| match cell {
            CellState::Free => [235, 235, 235, 255],
            CellState::Occupied => [40, 40, 48, 255],
            CellState::Unknown => [140, 140, 140, 128],
        })
        .collect();
    grid(time, map, &["red", "green", "blue", "alpha"], data)
}

/// The map as numbers: 0 free, 100 occupied, 255 unknown.
pub(in crate::record) fn map_occupancy(time: SimTime, map: &GridSample<'_>) -> Grid {
    let data = map
        .cells
        .iter()
        .map(|cell| match cell {
            CellState::Free => 0,
            CellState::Occupied => 100,
            CellState::Unknown => 255,
        })
        .collect();
    grid(time, map, &["occupancy"], data)
}

fn grid(time: SimTime, map: &GridSample<'_>, fields: &[&str], data: Vec<u8>) -> Grid {
    let stride = fields.len() as u32;
    Grid {
        timestamp: Some(timestamp(time)),
        frame_id: MAP.to_owned(),
        pose: Some(pose(
            vector(map.origin[0], map.origin[1], 0.0),
            turn(map.yaw, 0.0),
        )),
        column_count: map.width as u32,
        cell_size: Some(Vector2 {
            x: map.resolution,
            y: map.resolution,
        }),
        row_stride: map.width as u32 * stride,
        cell_stride: stride,
        fields: (0..)
            .zip(fields)
            .map(|(offset, name)| PackedElementField {
                name: (*name).to_owned(),
                offset,
                r#type: packed_element_field::NumericType::Uint8 as i32,
            })
            .collect(),
        data: data.into(),
    }
}
