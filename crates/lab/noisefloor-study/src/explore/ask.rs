//! Requests about verdicts, disagreements and retraining.

use super::answers::TileAnswer;
use super::api::{Answer, Named, Shared, blocking, describe, gone, kept, refuse};
use super::app::App;
use super::gallery::{GalleryError, GalleryPicture};
use super::job::{self, Job};
use super::learn::LearnStep;
use super::line::fit_line;
use super::verdicts::{Answered, Judge, Question};
use axum::Json;
use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::http::header::{CONTENT_DISPOSITION, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use noisefloor::{Model, People};
use noisefloor_pages::http::{Refusal, read_json};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// The model in use: the one given, or the retrained one.
fn model(app: &App, retrained: bool) -> Result<Model, Refusal> {
    if !retrained {
        return Ok(app.setup.model.clone());
    }
    let model = app.job().model().cloned().ok_or_else(|| gone("retrained"))?;
    let given = &app.setup.model;
    if (model.descriptor(), model.evidence()) != (given.descriptor(), given.evidence()) {
        let what =
            "the retrained model goes by another descriptor or evidence than the one this was started with";
        return Err(refuse(what, "retrained", "save it, and start again with --model"));
    }
    Ok(model)
}

fn judge(app: &App, question: &Question) -> Result<Judge, Refusal> {
    let model = model(app, question.retrained)?;
    let made = Judge::new(model, people(question.people)?, question.audience);
    made.map_err(|what| {
        refuse(what, "people", "a share of people lies between 0 and 1, an audience line rises")
    })
}

fn people(share: f32) -> Result<People, Refusal> {
    People::new(share)
        .map_err(|_| refuse("a share of people lies between 0 and 1", "people", "move the slider"))
}

/// `POST /api/verdicts`
pub(crate) async fn verdicts(State(app): Shared, body: Body) -> Answer {
    let question: Question = read_json(body).await?;
    let judge = judge(&app, &question)?;
    let tiles = describe(&app, &question.picture).await?;
    let id = question.picture.clone();
    let all = kept(&app, |kept| kept.all()).await?;
    let here = all.into_iter().filter(|d| d.said.picture == id);
    let said: HashMap<[usize; 4], Answered> =
        here.map(|d| (d.said.tile, Answered { id: d.id, sees_noise: d.said.sees_noise })).collect();
    let picture = picture(&app, &id)?;
    let view = judge.view(&picture, &tiles, &said);
    Ok(Json(view.map_err(|what| refuse(what, "audience", "choose the observers of the training data"))?)
        .into_response())
}

fn picture(app: &App, id: &str) -> Result<GalleryPicture, Refusal> {
    app.gallery().pictures.iter().find(|p| p.id == id).cloned().ok_or_else(|| GalleryError::Gone.into())
}

/// An answer about a tile whose verdict was shown.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Disagreeing {
    question: Question,
    tile: usize,
    sees_noise: bool,
}

#[derive(Serialize)]
struct Kept {
    id: i64,
    /// The earlier answer about the tile.
    before: Option<bool>,
    disagreements: usize,
}

/// `POST /api/disagreements`. The verdict is recomputed here, not taken from the request.
pub(crate) async fn disagree(State(app): Shared, body: Body) -> Answer {
    let Disagreeing { question, tile, sees_noise } = read_json(body).await?;
    let judge = judge(&app, &question)?;
    let tiles = describe(&app, &question.picture).await?;
    let picture = picture(&app, &question.picture)?;
    let scene = app.gallery().scene();
    let verdicts = judge.verdicts(&tiles).map_err(|what| refuse(what, "audience", "choose another"))?;
    let (Some(verdict), Some(numbers)) = (verdicts.get(tile), judge.numbers(&tiles, tile)) else {
        return Err(gone("tile"));
    };
    let (descriptor, evidence) = judge.kind();
    let at = tiles.grid.tile(tile);
    let said = TileAnswer {
        picture: picture.id,
        name: picture.name,
        scene,
        spp: tiles.spp,
        tile: [at.x, at.y, at.width, at.height],
        sees_noise,
        probability: verdict.probability.unwrap_or(0.0),
        threshold: question.people,
        audience: question.audience,
        model: judge.oracle.model().digest(),
        descriptor: descriptor.spec(),
        descriptor_version: descriptor.version(),
        evidence,
        numbers,
    };
    let here = here(&app);
    let done = kept(&app, move |kept| {
        kept.name_scene(&here.0, &here.1)?;
        let (id, before) = kept.keep(&said)?;
        Ok(Kept { id, before, disagreements: kept.all()?.len() })
    });
    Ok((StatusCode::CREATED, Json(done.await?)).into_response())
}

/// `POST /api/line`: the line of the person who answered, at the model and share of people of a question.
pub(crate) async fn line(State(app): Shared, body: Body) -> Answer {
    let Retraining { people: share } = read_json(body).await?;
    let people = people(share)?;
    let all = kept(&app, |kept| kept.all()).await?;
    let model = app.setup.model.clone();
    let work = move || {
        let fitting = all.iter().filter(|d| d.said.fits(model.descriptor(), model.evidence()));
        let answers: Vec<_> = fitting.map(|d| d.said.answer()).collect();
        fit_line(&model, people, &answers)
    };
    Ok(Json(blocking(work).await?).into_response())
}

/// `DELETE /api/disagreements/{id}`
pub(crate) async fn take_back(State(app): Shared, id: Named) -> Answer {
    let id = id.ok().and_then(|Path(id)| id.parse::<i64>().ok()).ok_or_else(|| gone("disagreement"))?;
    if kept(&app, move |kept| kept.take_back(id)).await? {
        Ok(StatusCode::NO_CONTENT.into_response())
    } else {
        Err(gone("disagreement"))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Retraining {
    people: f32,
}

/// `POST /api/retrain`
pub(crate) async fn retrain(State(app): Shared, body: Body) -> Answer {
    let at = people(read_json::<Retraining>(body).await?.people)?;
    let Some(table) = app.setup.table.clone() else {
        let do_ = "start `noisefloor-lab explore --table FILE`, \
            with the project's fixtures/human-table.csv or a table written by `train --save-table`";
        return Err(refuse("there is no table of human thresholds to train on", "table", do_));
    };
    let here = here(&app);
    let all = kept(&app, move |kept| {
        kept.name_scene(&here.0, &here.1)?;
        kept.all()
    });
    let all = all.await?;
    let fitting = all.iter().filter(|d| d.said.fits(&table.descriptor, table.evidence));
    let answers: Vec<_> = fitting.map(|d| d.said.answer()).collect();
    if answers.is_empty() {
        return Err(refuse(
            "there is nothing to learn yet",
            "disagreements",
            "disagree with a verdict first",
        ));
    }
    {
        let mut job = app.job();
        if job.is_running() {
            let what = "the model is being retrained already";
            return Err(Refusal::new(StatusCode::CONFLICT, what, "retrain", "wait until it is done"));
        }
        *job = Job::Running(LearnStep { done: 0, of: 1, doing: "beginning".into() });
    }
    job::begin(app.job.clone(), table, answers, app.setup.model.clone(), at);
    Ok((StatusCode::ACCEPTED, Json(&*app.job())).into_response())
}

/// `GET /api/retrain`
pub(crate) async fn progress(State(app): Shared) -> Response {
    Json(&*app.job()).into_response()
}

/// `GET /api/retrained.nfm`
pub(crate) async fn retrained(State(app): Shared) -> Answer {
    let model = app.job().model().cloned().ok_or_else(|| gone("retrained"))?;
    let mut file = Vec::new();
    model.write(&mut file).map_err(|e| refuse(e.to_string(), "model", "train it again"))?;
    let head = [
        (CONTENT_TYPE, "application/octet-stream"),
        (CONTENT_DISPOSITION, "attachment; filename=\"retrained.nfm\""),
    ];
    Ok((head, file).into_response())
}

/// The pictures in the gallery, and the current name of their scene.
fn here(app: &App) -> (Vec<String>, String) {
    let gallery = app.gallery();
    (gallery.pictures.iter().map(|p| p.id.clone()).collect(), gallery.scene())
}
