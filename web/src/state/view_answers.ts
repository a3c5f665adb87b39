// Questions to the 3D view and its answers, which come as events. A question that is never answered ends with the view.
import type { Slice, ToolpathHost, ViewEvent } from '@stepcast/toolpath';

type Answer = Extract<ViewEvent, { readonly id: number }>;

/** Questions that wait at once; with more the view is stuck, and the oldest is given up. */
const WAITING_MAX = 64;

let host: ToolpathHost | null = null;
let lastId = 0;
const waiting = new Map<number, (answer: Answer | null) => void>();

/** The view that is there from now on, or none. */
export function answerWith(view: ToolpathHost | null): void {
  host = view;
  for (const settle of waiting.values()) settle(null);
  waiting.clear();
}

/** Takes an event that may be an answer. */
export function takeAnswer(event: ViewEvent): void {
  if (!('id' in event)) return;
  waiting.get(event.id)?.(event);
  waiting.delete(event.id);
}

function ask(question: (view: ToolpathHost, id: number) => void): Promise<Answer | null> {
  const view = host;
  if (!view) return Promise.resolve(null);
  lastId += 1;
  const id = lastId;
  const [oldest] = waiting;
  if (waiting.size >= WAITING_MAX && oldest) {
    waiting.delete(oldest[0]);
    oldest[1](null);
  }
  return new Promise((settle) => {
    waiting.set(id, settle);
    question(view, id);
  });
}

/** The vertex whose segment is drawn at a point of the view, in CSS pixels from its left top; null for none. */
export async function vertexAt(x: number, y: number): Promise<number | null> {
  const answer = await ask((view, id) => view.pick(x, y, id));
  return answer?.type === 'picked' ? answer.vertex : null;
}

/** Vertices `first … end − 1` with what is known of them; null without a view. */
export async function verticesOf(first: number, end: number): Promise<Slice | null> {
  const answer = await ask((view, id) => view.slice(first, end, id));
  return answer?.type === 'slice' ? answer.slice : null;
}

/** Waits until all that the view was asked for up to now is shown in full detail, or there is no view. */
export async function settled(): Promise<void> {
  await ask((view, id) => view.settle(id));
}

/** A PNG of the view in full detail. */
export async function pictureOf(width: number, height: number): Promise<Blob | null> {
  const answer = await ask((view, id) => view.picture(id, { width, height }));
  return answer?.type === 'picture' ? answer.blob : null;
}
