// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.
import type { Bytes, Seconds } from './units';

/**
 * Counts of a link since the connection began.
 */
export type LinkView = { 
/**
 * Everything handed to the port.
 */
sent_bytes: Bytes, 
/**
 * Everything that came from it.
 */
received_bytes: Bytes, 
/**
 * Of what was sent, what was sent again.
 */
retransmitted_bytes: Bytes, 
/**
 * Times that something was sent again because no answer came.
 */
timeouts: number, 
/**
 * Stretches of received bytes that made no sense.
 */
garbage: number, 
/**
 * The smoothed round-trip time.
 */
round_trip_s: Seconds | null, 
/**
 * The host's time of the last sound answer.
 */
last_received_s: Seconds | null, };
