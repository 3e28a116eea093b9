//! Nested dissection by METIS.

use super::graph::Graph;

/// METIS draws from the C library's `rand`, whose state is the process's: calls at the same time would disturb each
/// other's orders, and with them the last digits of every solution. One at a time each call seeds it anew.
static METIS: std::sync::Mutex<()> = std::sync::Mutex::new(());

/// METIS_NodeND; `None` where the library refuses (empty graph, no memory), in which case any order is correct.
pub(super) fn nested_dissection(graph: &Graph) -> Option<Vec<u32>> {
    let mut n = (graph.offsets.len() - 1) as i32;
    if n == 0 || graph.neighbours.is_empty() {
        return None;
    }
    let (mut offsets, mut neighbours) = (graph.offsets.clone(), graph.neighbours.clone());
    let mut options = [-1i32; metis_sys::METIS_NOPTIONS as usize];
    let (mut perm, mut inverse) = (vec![0i32; n as usize], vec![0i32; n as usize]);
    // The lock guards no data, so a poisoned one is as good.
    let _one_at_a_time = METIS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    // SAFETY: the arrays have the lengths that METIS documents (n + 1, offsets[n], METIS_NOPTIONS, n, n), indices are
    // in range by construction, and all outlive the call.
    let status = unsafe {
        metis_sys::METIS_NodeND(
            &mut n,
            offsets.as_mut_ptr(),
            neighbours.as_mut_ptr(),
            std::ptr::null_mut(),
            options.as_mut_ptr(),
            perm.as_mut_ptr(),
            inverse.as_mut_ptr(),
        )
    };
    (status == metis_sys::rstatus_et_METIS_OK).then(|| perm.into_iter().map(|v| v as u32).collect())
}
