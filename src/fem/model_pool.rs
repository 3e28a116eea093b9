//! A model that may be solved at several drives or for several materials side by side.

use super::forward_model::ForwardModel;
use std::sync::{Mutex, MutexGuard};

/// A model, and as many others like it as were needed at a time. They share mesh, elimination order and symbolic
/// factorisation; each has a tangent and a factor of its own, which stay from one use to the next.
pub(crate) struct ModelPool {
    own: ForwardModel,
    idle: Mutex<Vec<ForwardModel>>,
}

impl ModelPool {
    /// Of `own`.
    pub(crate) fn new(own: ForwardModel) -> ModelPool {
        ModelPool { own, idle: Mutex::default() }
    }

    /// The model that all are like.
    pub(crate) fn own(&self) -> &ForwardModel {
        &self.own
    }

    /// The same, to be solved with where nothing else is at the same time.
    pub(crate) fn own_mut(&mut self) -> &mut ForwardModel {
        &mut self.own
    }

    /// Does `work` with a model that nothing else uses meanwhile. What comes of it does not depend on which it is: what
    /// a model solved last never changes what is solved next.
    pub(crate) fn with<R>(&self, work: impl FnOnce(&mut ForwardModel) -> R) -> R {
        let idle = self.idle().pop();
        let mut model = idle.unwrap_or_else(|| self.own.another());
        let result = work(&mut model);
        self.idle().push(model);
        result
    }

    /// A panic elsewhere leaves the list as it is.
    fn idle(&self) -> MutexGuard<'_, Vec<ForwardModel>> {
        self.idle.lock().unwrap_or_else(|e| e.into_inner())
    }
}
