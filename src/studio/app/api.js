// @ts-check
// Requests to the studio's server, and what they answer.

import { read } from './place.js';

/**
 * @typedef {Record<'vx_dot' | 'vy_dot' | 'vz_dot' | 'wx_dot' | 'wy_dot' | 'wz_dot' | 'mean', number | null>} PerChannel
 * @typedef {Record<string, [number, number] | null>} Intervals
 * @typedef {{ symbol: string, name: string, unit: string }} Channel
 * @typedef {{ name: string, manoeuvre: string, duration_s: number, step_s: number, derived: boolean, judges: number }} Flight
 * @typedef {{ version: string, data: string, duration_s: number, parts_s: [number, number], judging: string, flights: Flight[], channels: Channel[],
 *   variables: [string, string][], names: string[], signals: [string, string, string][], check: string, fault: boolean }} Overview
 * @typedef {{ id: number, did: string, rmse: PerChannel | null, ci95: Intervals | null, r2: PerChannel | null, calibrated: boolean }} Step
 * @typedef {{ steps: Step[], at: number, judged_on: string, own_from_other_half: boolean, saved: boolean, file: string | null,
 *   file_changed: boolean, kept: string | null, unkept: string | null, left: Left[], revision: number }} Steps
 * @typedef {{ file: string, written_s: number, steps: string[], search: string | null, fault: string | null }} Left
 * @typedef {{ revision: number, file_changed: boolean, search: Job['progress'], training: Job['progress'] }} Pulse
 * @typedef {{ name: string, meaning: string, value: number, unit: string, ci95: [number, number] | null, usual: [number, number] | null,
 *   bounds: [number | null, number | null], slider: [number, number], fixed: boolean, by_flight: [number, number, number] | null }} Numeral
 * @typedef {{ name: string, kind: string, meaning: string, formula: string, enabled: boolean, baseline: boolean, added_by: string | null,
 *   numbers: Numeral[] }} Effect
 * @typedef {{ name: string, vehicle: string, state: number, effects: Effect[], addable: [string, string][],
 *   calibration: { condition_number: number, rows: number, last_change: number } | null, doubts: string[], toml: string | null }} Model
 * @typedef {{ t: number[], measured: number[], predicted: number[], residual: number[], against: number[] | null, against_residual: (number | null)[] | null,
 *   sticks: number[][], whole_s: [number, number], samples_per_point: number, rmse: number, against_rmse: number | null }} Trace
 * @typedef {{ effect: string, number: string, value: number }} Moved
 * @typedef {{ flight: number, channel: number, from_s: number | null, to_s: number | null, pixels: number, against: number | null,
 *   moved?: Moved | null }} TraceWanted
 * @typedef {{ rmse: number | null, ci95: [number, number] | null, relative: number | null, paper: string, ink: string }} MapCell
 * @typedef {{ name: string, rule: string | null, n: number, blocks: number, cells: MapCell[] }} MapRow
 * @typedef {{ rows: MapRow[], whole: MapRow, deviation: PerChannel, basis: string, caution: string | null }} ErrorMap
 * @typedef {{ at: number, mean: number, ci95: [number, number] | null, n: number, blocks: number }} Bin
 * @typedef {{ variables: { name: string, unit: string, share: number, bins: Bin[] }[], basis: string }} Dependence
 * @typedef {{ surface: { channel: string, variables: [string, string], edges: [number[], number[]], share: number,
 *   cells: { column: number, row: number, mean: number, ci95: [number, number] | null, n: number, blocks: number, thin: boolean }[] } | null,
 *   units: [string, string], names: string[] }} Surface
 * @typedef {{ flight: number, from_s: number, to_s: number }} Spot
 * @typedef {{ rule: string, rmse: number, ci95: [number, number] | null, share_of_error: number, share_of_time: number, blocks: number,
 *   worst: Spot | null }} Region
 * @typedef {{ whole: Region | null, regions: Region[], even: boolean, why: string | null }} Regions
 * @typedef {{ stick: string, lag_s: number[], correlation: number[], band95: (number | null)[], feedback_warning: boolean }} Following
 * @typedef {{ autocorrelation: { lag_s: number[], correlation: number[], lasts_s: number | null } | null,
 *   spectrum: { frequency_hz: number[], density: number[], segments: number } | null, sticks: Following[], why: string | null }} InTime
 * @typedef {{ name: string, kind: 'model' | 'network', written_s: number, open: boolean, says: string, error: string | null }} Run
 * @typedef {{ folder: string, rows: Run[], left_out: number, why: string | null }} Runs
 * @typedef {{ rmse: PerChannel, ci95: Intervals, basis: string }} RunErrors
 * @typedef {{ channel: number, panels: { name: string, unit: string, read: boolean, before: Bin[], after: Bin[], change: Bin[] }[] }} Curve
 * @typedef {{ why: string }} Missing what a log does not allow, and what to do
 * @typedef {'position' | 'velocity' | 'attitude' | 'rates'} Quantity
 * @typedef {{ at_s: number, ahead_s: number[], measured: Record<Quantity, number[][]>, note: string | null,
 *   paths: { name: string, states: Record<Quantity, number[][]>, error: Record<Quantity, number[]>, stopped_s: number | null }[] }} Rollout
 * @typedef {{ basis: string, caution: string | null, legend: string, rollouts: { horizon: number, step_s: number, position_from_velocity: boolean,
 *   relative_to: string, rows: { name: string, n: number, diverged: number, error: Record<Quantity, number[]>,
 *   difference_percent: Record<Quantity, number | null>, difference_percent_ci95: Record<Quantity, [number, number] | null> }[] } }} Rollouts
 * @typedef {{ share: number, ci95: [number, number] | null }} Share
 * @typedef {{ effect: string, meaning: string, channels: string[], held_out_mse_fall: Record<string, number>, p_value: number, stability: string,
 *   selection_frequency: number, indistinguishable: string[], coefficients: (Numeral & { expected?: [number, number], sign?: string })[],
 *   parameters: { name: string, value: number, fixed: boolean, unit: string, profile?: [number, number] }[], would_tell_apart: string,
 *   fault_of_log?: string, formula: string, rests_on_flight: string | null }} Found
 * @typedef {{ effect: string, status: string, reason: string, note: string | null, p_value: number | null }} Candidate
 * @typedef {{ verdict: string, summary: string, accepted: string[], steps: Found[], candidates: Candidate[], confirmation: string | null,
 *   unknown: { channel: string, r2: number, shape: string, depends_on: { variable: string, share: number }[], suggested_formula: string | null }[] | null,
 *   locked: { mse_fall: Record<string, [number, number, number]>, duration_s: number } | null,
 *   worth?: { effect: string, share: Record<string, Share> }[], notes: string[], seconds: number }} Diagnosis
 * @typedef {{ progress: 'idle' | 'running' | 'stopping' | 'stopped' | 'failed' | 'done', stage: string, seconds: number, error: string | null,
 *   diagnosis: Diagnosis | null, state: number | null, state_did: string | null }} Job
 * @typedef {{ folder: string, history: number, width: number, epochs: number, step_s: number,
 *   unfinished: { folder: string, name: string, says: string, why: string | null }[] }} TrainingPlan
 * @typedef {{ training: number, validation: number | null }} EpochLoss
 * @typedef {{ progress: Job['progress'], says: string, folder: string, name: string, state: number | null, state_did: string | null,
 *   parameters: number | null, windows: [number, number], steps: [number, number], epochs: [number, number], loss: number | null, curve: EpochLoss[],
 *   seconds: number, left_s: number | null, error: string | null,
 *   trained: { epoch: number, training_loss: number, validation_loss: number | null, curve: EpochLoss[] } | null, gate: string | null }} Training
 * @typedef {Record<keyof PerChannel, Share | null>} ShareOf
 * @typedef {{ says: string, rmse: [PerChannel, PerChannel], ci95: [Intervals, Intervals], basis: string, shares: { physics: ShareOf, network: ShareOf,
 *   neither: ShareOf, of_network: { linear_history: ShareOf, network_itself: ShareOf } | null } }} Explained
 * @typedef {{ message: string | null, at: number | null, caution: string | null }} FormulaCheck
 * @typedef {{ file: string, kept: string | null, ledger: string | null }} Saved
 */

/** What the server refuses, or that it is gone. */
export class Refused extends Error {
  /**
   * @param {number} status 0 where nobody answered
   * @param {{ kind: string, message: string, at?: number | null }} text
   */
  constructor(status, text) {
    super(text.message);
    this.status = status;
    this.kind = text.kind;
    this.at = text.at ?? null;
  }
}

/**
 * @param {string} name
 * @param {unknown} [body]
 * @returns {Promise<any>}
 */
export async function ask(name, body = {}) {
  let response;
  try {
    response = await fetch(`/api/${name}`, {
      method: 'POST',
      headers: { 'content-type': 'application/json', 'x-studio-token': read().token },
      body: JSON.stringify(body),
    });
  } catch {
    throw new Refused(0, { kind: 'gone', message: 'the studio does not answer: its program has ended' });
  }
  const answer = await response.json();
  if (!response.ok) throw new Refused(response.status, answer.error);
  return answer;
}
