//! Tests of noisefloor-study, one module a subject.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails by a panic, and may print")]

mod api; // requests that are refused, and what they and held connections leave behind: nothing
mod browser; // the pages in a real browser
mod chain; // page, server, database, analysis and corpus, end to end, by simulated observers
mod coverage; // how often the analysis' intervals hold the truth
mod explore; // one's own pictures: verdicts, disagreements, and learning from them
mod explore_refusals; // requests to the explorer that are refused
mod kill; // a server that is killed has lost nothing that it acknowledged
mod kit; // studies, stacks and servers for the tests
mod outputs; // raw data, languages and copies of the database
mod proxy; // a study behind a real proxy
mod session; // the state of a session, without a server
mod stored; // the trials that are stored with a session
mod study; // study files and stacks, good and bad
