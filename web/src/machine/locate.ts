// Where in its file an interrupted print was, after its board has lost everything: by its journal and the file. Moves nothing
// and needs no board.
import { FileChunks } from '../files';
import { type Archive, troubleOf } from './archive';
import type { Planner } from './planner';
import type { Interruption, KeptFile } from './protocol';
import type { Survey } from './session';
import { fileUnreadable } from './troubles';

/** Reads no more of the file than is wanted. */
async function read(survey: Survey, file: Blob): Promise<Interruption | null> {
  const chunks = await FileChunks.open(file).catch((error: unknown) => Promise.reject(new Unreadable(error)));
  try {
    while (survey.report() === null) {
      const chunk = await chunks.next().catch((error: unknown) => Promise.reject(new Unreadable(error)));
      if (!chunk) {
        survey.end();
        break;
      }
      for (let rest = chunk; rest.byteLength > 0; ) {
        const piece = rest.subarray(0, survey.wants());
        if (piece.byteLength === 0 && survey.report() === null)
          throw new Error('the survey wants nothing more');
        if (piece.byteLength === 0) break;
        survey.feed(piece);
        rest = rest.subarray(piece.byteLength);
      }
    }
    return survey.report();
  } finally {
    await chunks.cancel();
  }
}

class Unreadable extends Error {
  constructor(cause: unknown) {
    super('the file cannot be read', { cause });
  }
}

/** The file of a kept print, and the print's place in it. Rejects with what nobody foresaw. */
export async function locate(
  planner: Pick<Planner, 'survey' | 'asTrouble'>,
  archive: Pick<Archive, 'recordOf'>,
  id: string,
  file: Blob,
): Promise<KeptFile> {
  const record = await archive.recordOf(id).catch(troubleOf);
  if ('code' in record) return { kind: 'there', file, at: null, trouble: record };
  let survey: Survey | undefined;
  try {
    survey = planner.survey(record.config, record.journal);
    return { kind: 'there', file, at: await read(survey, file), trouble: null };
  } catch (error) {
    if (error instanceof Unreadable) return { kind: 'missing', trouble: fileUnreadable(error.cause) };
    const trouble = planner.asTrouble(error);
    if (!trouble) throw error;
    return { kind: 'there', file, at: null, trouble };
  } finally {
    survey?.free();
  }
}
