// Generated from planner-wasm/src/messages by `cargo xtask bindings`. Do not edit.

/**
 * What a file is, from its first bytes.
 */
export type FileKindReport = { 
/**
 * A stable name.
 */
kind: 'gcode' | 'gzip' | 'binary-gcode' | '3mf' | 'stl' | 'zip' | 'other-text' | 'other-binary' | 'empty', 
/**
 * What to do instead; `null` for what can be read (gzip once it is unpacked).
 */
advice: string | null, };
