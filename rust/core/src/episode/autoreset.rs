//! A step in which episodes that are over are followed by the next.

use super::batch::{EpisodeBatch, Final, Stepped};
use super::beginning::{Beginning, EpisodeDistribution};
use super::error::EpisodeError;
use crate::draw::{Fixed, Order};

/// When the next episode of a rover begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Autoreset {
    /// In the step after that in which the last one ended; the rover does not move in it and earns
    /// nothing.
    NextStep,
    /// In the step in which the last one ends: see [`EpisodeBatch::finals`].
    SameStep,
}

/// How episodes follow one another.
#[derive(Clone, Copy, Debug)]
pub struct Succession<'a> {
    /// What the next ones are drawn from.
    pub distribution: &'a EpisodeDistribution,
    /// Most scenes drawn for a rover until it has room.
    pub attempts: usize,
    /// When they begin.
    pub autoreset: Autoreset,
}

impl EpisodeBatch {
    /// Gives every rover its action for one control period and begins the next episodes of those
    /// that are over, drawn from the rovers' own generators on the threads of the batch. Arguments
    /// and results are those of [`EpisodeBatch::step_while`], where all rovers move whose episode
    /// was not over.
    ///
    /// A row holds the first observation where an episode has begun. The results are those of the
    /// episodes that ended with [`Autoreset::SameStep`]; with [`Autoreset::NextStep`] those of the
    /// episodes that have begun, which earn nothing. If an episode that is to follow in the same
    /// step cannot be drawn, none begins, and the next call refuses it. No rover moves, and the
    /// results are empty, if `go_on` returns false during the first draw.
    ///
    /// # Errors
    /// As [`EpisodeBatch::step_while`]; as [`EpisodeDistribution::draw`] for an episode that was
    /// over before the call. No rover has moved then.
    ///
    /// # Panics
    /// As [`EpisodeBatch::step_while`].
    pub fn step_on(
        &mut self,
        actions: &[f64],
        succession: &Succession<'_>,
        has_scan: bool,
        observations: &mut [f32],
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Stepped, EpisodeError> {
        self.check_step(actions, None)?;
        let starting = self.over();
        let Some(next) = self.draw_next(&starting, succession, go_on)? else {
            return Ok(Stepped::default());
        };
        let active = (!starting.is_empty()).then(|| {
            let mut active = vec![true; self.rovers().len()];
            for &index in &starting {
                active[index] = false;
            }
            active
        });
        let mut stepped =
            self.step_while(actions, active.as_deref(), has_scan, observations, go_on)?;
        if !starting.is_empty() {
            self.begin_next(&starting, next, observations)?;
            stepped = self.results();
            stepped.begun = starting;
        }
        if succession.autoreset == Autoreset::SameStep && !stepped.over.is_empty() {
            self.keep_finals(&stepped.over)?;
            // What cannot be drawn is refused by the next call.
            if let Ok(Some(next)) = self.draw_next(&stepped.over, succession, go_on) {
                self.begin_next(&stepped.over, next, observations)?;
                stepped.begun.extend(&stepped.over);
            }
        }
        Ok(stepped)
    }

    /// The episodes that the last step has ended and, unless they were refused, followed by the
    /// next: with [`Autoreset::SameStep`] only, in the order of the rovers.
    #[must_use]
    pub fn finals(&self) -> &[Final] {
        &self.finals
    }

    fn keep_finals(&mut self, over: &[usize]) -> Result<(), EpisodeError> {
        for &index in over {
            let kept = Final {
                index,
                episode: self.episode(index)?.clone(),
                error: self.errors()[index].clone(),
            };
            self.finals.push(kept);
        }
        Ok(())
    }

    /// Draws the next episodes of rovers; None if `go_on` has returned false.
    fn draw_next(
        &mut self,
        indices: &[usize],
        succession: &Succession<'_>,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Beginning>>, EpisodeError> {
        if indices.is_empty() {
            return Ok(Some(Vec::new()));
        }
        let fixed = Fixed::default();
        let order = |&index: &usize| {
            Ok(Order {
                random: self.generator(index)?,
                difficulty: self.difficulty(index)?,
                fixed: &fixed,
            })
        };
        let orders = indices.iter().map(order);
        let orders: Vec<_> = orders.collect::<Result<_, EpisodeError>>()?;
        let drawn = self.draw(succession.distribution, &orders, succession.attempts, go_on)?;
        for (&index, one) in indices.iter().zip(drawn.iter().flatten()) {
            self.check(index, one)?;
        }
        Ok(drawn)
    }

    /// Begins drawn episodes and writes their first observations.
    fn begin_next(
        &mut self,
        indices: &[usize],
        next: Vec<Beginning>,
        observations: &mut [f32],
    ) -> Result<(), EpisodeError> {
        let size = self.rules().size();
        for (&index, one) in indices.iter().zip(next) {
            let row = &mut observations[index * size..][..size];
            row.copy_from_slice(one.episode.observation());
            self.begin(index, one)?;
        }
        Ok(())
    }
}
