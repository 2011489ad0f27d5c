//! Networks on the tape: layers, Phy-Ture, its ablations and fusion variants.
