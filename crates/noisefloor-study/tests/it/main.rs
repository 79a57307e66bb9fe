//! Tests of noisefloor-study, one module a subject.

/// Requests that are refused, and what they leave behind: nothing.
#[cfg(test)]
mod api;
/// The pages in a real browser.
#[cfg(test)]
mod browser;
/// Page, server, database, analysis and corpus, end to end, by simulated observers.
#[cfg(test)]
mod chain;
/// How often the analysis' intervals hold the truth.
#[cfg(test)]
mod coverage;
/// One's own pictures: verdicts, disagreements, and learning from them.
#[cfg(test)]
mod explore;
/// Requests to the explorer that are refused.
#[cfg(test)]
mod explore_refusals;
/// A server that is killed has lost nothing that it acknowledged.
#[cfg(test)]
mod kill;
/// Connections that are held open.
#[cfg(test)]
mod hold;
/// Studies, stacks and servers for the tests.
#[cfg(test)]
mod kit;
/// Fifty observers at once.
#[cfg(test)]
mod load;
/// The state of a session, without a server.
#[cfg(test)]
mod session;
/// Study files and stacks, good and bad.
#[cfg(test)]
mod study;
