//! Reverse mode: graph, plan, session, operations, gradient check.
