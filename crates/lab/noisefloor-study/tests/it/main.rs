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
/// Connections that are held open.
#[cfg(test)]
mod hold;
/// A server that is killed has lost nothing that it acknowledged.
#[cfg(test)]
mod kill;
/// Studies, stacks and servers for the tests.
#[cfg(test)]
mod kit;
/// Two hundred observers at once.
#[cfg(test)]
mod load;
/// Raw data, languages and copies of the database.
#[cfg(test)]
mod outputs;
/// A study behind a real proxy.
#[cfg(test)]
mod proxy;
/// The state of a session, without a server.
#[cfg(test)]
mod session;
/// Databases of earlier versions, and the trials that are stored with a session.
#[cfg(test)]
mod stored;
/// Study files and stacks, good and bad.
#[cfg(test)]
mod study;
