//! Requests by name: JSON in, a method of the studio, JSON out.

use super::Refusal;
use crate::flight::Channel;
use crate::studio::{By, Edit, Owner, PartWanted, PlaceWanted, RolloutWanted, Studio, SurfaceWanted, TraceWanted, TrainingWanted};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A state by identifier, or the present one.
#[derive(Deserialize)]
struct OfState {
    #[serde(default)]
    state: Option<u64>,
}

/// A state by identifier.
#[derive(Deserialize)]
struct ToState {
    state: u64,
}

#[derive(Deserialize)]
struct MapWanted {
    #[serde(default)]
    part: PartWanted,
    #[serde(default)]
    by: By,
}

/// One channel on a part of the data.
#[derive(Deserialize)]
struct ChannelWanted {
    #[serde(default)]
    part: PartWanted,
    channel: Channel,
}

/// How far rollouts go, and the network that takes part.
#[derive(Deserialize)]
struct AheadWanted {
    ahead_s: f64,
    #[serde(default)]
    network: Option<String>,
}

/// A network by its name in the folder.
#[derive(Deserialize)]
struct NetworkWanted {
    name: String,
}

/// A run by its name in the folder; the present state without.
#[derive(Deserialize)]
struct RunWanted {
    name: Option<String>,
}

/// An effect that a search has found.
#[derive(Deserialize)]
struct CurveWanted {
    effect: String,
}

#[derive(Deserialize)]
struct FormulaWanted {
    owner: Owner,
    formula: String,
}

#[derive(Deserialize)]
struct FileWanted {
    path: String,
    #[serde(default)]
    overwrite: bool,
}

/// A draft by its file, as it was told.
#[derive(Deserialize)]
struct LeftWanted {
    file: String,
}

/// Answers a request.
pub(super) fn answer(studio: &Arc<Studio>, name: &str, body: &[u8]) -> Result<Vec<u8>, Refusal> {
    match name {
        "overview" => json(&studio.overview()),
        "steps" => json(&studio.steps()?),
        "pulse" => json(&studio.pulse()),
        "undo" => json(&studio.undo()?),
        "redo" => json(&studio.redo()?),
        "go_to" => json(&studio.go_to(parsed::<ToState>(body)?.state)?),
        "model" => json(&studio.model(parsed::<OfState>(body)?.state)?),
        "edit" => json(&studio.edit(&parsed::<Edit>(body)?)?),
        "check_formula" => {
            let FormulaWanted { owner, formula } = parsed(body)?;
            json(&studio.check_formula(&owner, &formula))
        }
        "trace" => json(&studio.trace(&parsed::<TraceWanted>(body)?)?),
        "map" => {
            let MapWanted { part, by } = parsed(body)?;
            json(&studio.map(part, by)?)
        }
        "place" => json(&studio.place(&parsed::<PlaceWanted>(body)?)?),
        "dependence" => {
            let ChannelWanted { part, channel } = parsed(body)?;
            json(&studio.dependence(part, channel)?)
        }
        "regions" => {
            let ChannelWanted { part, channel } = parsed(body)?;
            json(&studio.regions(part, channel)?)
        }
        "in_time" => {
            let ChannelWanted { part, channel } = parsed(body)?;
            json(&studio.in_time(part, channel)?)
        }
        "rollout" => json(&studio.rollout(&parsed::<RolloutWanted>(body)?)?),
        "rollouts" => {
            let AheadWanted { ahead_s, network } = parsed(body)?;
            json(&studio.rollouts(ahead_s, network.as_deref())?)
        }
        "runs" => json(&studio.runs()),
        "run_errors" => json(&studio.run_errors(parsed::<RunWanted>(body)?.name.as_deref())?),
        "curve" => json(&studio.curve(&parsed::<CurveWanted>(body)?.effect)?),
        "surface" => json(&studio.surface(&parsed::<SurfaceWanted>(body)?)?),
        "diagnose" => json(&studio.diagnose()?),
        "job" => json(&studio.job()),
        "stop" => json(&studio.stop()),
        "training_plan" => json(&studio.training_plan()),
        "train" => json(&studio.train(&parsed::<TrainingWanted>(body)?)?),
        "training" => json(&studio.training()),
        "stop_training" => json(&studio.stop_training()),
        "explained" => json(&studio.explained(&parsed::<NetworkWanted>(body)?.name)?),
        "take_up" => json(&studio.take_up(&parsed::<LeftWanted>(body)?.file)?),
        "discard" => json(&studio.discard(&parsed::<LeftWanted>(body)?.file)?),
        "save" => {
            let FileWanted { path, overwrite } = parsed(body)?;
            json(&studio.save(&path, overwrite)?)
        }
        "save_page" => {
            let FileWanted { path, overwrite } = parsed(body)?;
            json(&studio.save_page(&path, overwrite)?)
        }
        "save_diagnosis" => {
            let FileWanted { path, overwrite } = parsed(body)?;
            json(&studio.save_diagnosis(&path, overwrite)?)
        }
        _ => Err(Refusal::new(404, "path", format!("there is no request `{name}`"))),
    }
}

fn parsed<T: DeserializeOwned>(body: &[u8]) -> Result<T, Refusal> {
    serde_json::from_slice(body).map_err(|error| Refusal::new(400, "json", format!("the body is not what was expected: {error}")))
}

fn json(value: &impl Serialize) -> Result<Vec<u8>, Refusal> {
    serde_json::to_vec(value).map_err(|error| Refusal::new(500, "json", error.to_string()))
}
