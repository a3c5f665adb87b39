/**
 * Small toolpaths for pictures that are compared: each shows one thing from near by.
 *
 * Units: mm.
 */
import type { ToolpathHost } from '../src/index';
import { EVENTS, FLAGS } from '../src/vertex';
import { arc, type Made, square, Writer } from './writer';

export interface Case {
  readonly make: () => Made;
  /** Sets the view up once the file is there. */
  readonly look: (host: ToolpathHost) => void;
}

/** Bends from slight to straight back, two layers of each. */
function joints(): Made {
  const out = new Writer();
  for (let layer = 0; layer < 2; layer++) {
    out.layer(10);
    [20, 60, 90, 120, 150, 180].forEach((degrees, at) => {
      const [x, y] = [(at % 3) * 4, Math.floor(at / 3) * 4];
      const turn = (degrees * Math.PI) / 180;
      out.manner.widthMm = 0.45 + 0.15 * (at % 2);
      out.line([
        [x, y],
        [x + 2, y],
        [x + 2 + 1.6 * Math.cos(turn), y + 1.6 * Math.sin(turn)],
      ]);
    });
  }
  return out.made();
}

function arcs(): Made {
  const out = new Writer();
  for (let layer = 0; layer < 4; layer++) {
    out.layer(10);
    for (const inset of [0, 0.45, 0.9]) {
      out.manner.feature = inset === 0 ? 'outerWall' : 'innerWall';
      out.line(arc(0, 0, 5 - inset, 0, 1.5 * Math.PI, 90));
    }
  }
  return out.made();
}

/** Two posts: travels between them, wipes, retractions, seams, a change of the tool, a pause. */
function moves(): Made {
  const out = new Writer();
  for (let layer = 0; layer < 3; layer++) {
    out.layer(10);
    for (const post of [0, 1]) {
      out.manner.tool = post;
      out.loop(square(post * 8, 0, post * 8 + 4, 4));
      out.to(post * 8 + 1.5, 0, FLAGS.travel | FLAGS.wipe | FLAGS.retract, EVENTS.toolChange);
      if (layer === 2 && post === 0) out.to(3, -1.5, FLAGS.travel | FLAGS.pause);
      if (layer === 1 && post === 1) out.to(14, 3, FLAGS.travel);
    }
  }
  return out.made();
}

/** Three steps of four posts; each value differs from layer to layer or from post to post. */
function values(): Made {
  const out = new Writer();
  for (let layer = 0; layer < 12; layer++) {
    Object.assign(out.manner, {
      heightMm: 0.2 + 0.01 * layer,
      reached: 1 - 0.05 * layer,
      accelMmS2: 1000 + 400 * layer,
      nozzleC: 230 - 2 * layer,
      fan: Math.min(layer * 10, 100),
    });
    out.layer(8 + (layer % 4) * 6);
    for (let post = 0; post < 4; post++) {
      if (layer >= 3 * (post + 1)) continue;
      Object.assign(out.manner, {
        widthMm: 0.4 + 0.1 * post,
        feedMmS: 30 + 40 * post,
        tool: post,
        object: post,
        feature: (['outerWall', 'support', 'infill', 'bridge'] as const)[post],
      });
      out.loop(square(post * 7, 0, post * 7 + 4, 4));
      out.line(square(post * 7 + 0.8, 0.8, post * 7 + 3.2, 3.2));
    }
  }
  return out.made();
}

const near = { azimuth: -0.5, elevation: 0.6 };
const valueCase = (look: (host: ToolpathHost) => void): Case => ({
  make: values,
  look: (host) => {
    host.fit(near);
    look(host);
  },
});

export const CASES: Readonly<Record<string, Case>> = {
  joints: { make: joints, look: (host) => host.fit({ azimuth: -0.2, elevation: 1.1 }) },
  'joints-level': {
    make: joints,
    look: (host) => {
      host.fit({ azimuth: -0.5, elevation: 0.35 });
      host.zoom(0.45, [-20, 20]);
    },
  },
  arc: { make: arcs, look: (host) => host.fit(near) },
  'arc-near': {
    make: arcs,
    look: (host) => {
      host.fit(near);
      host.zoom(0.3, [-75, 10]);
    },
  },
  travel: {
    make: moves,
    look: (host) => {
      host.show({ travel: true });
      host.fit(near);
    },
  },
  markers: {
    make: moves,
    look: (host) => {
      host.show({ wipes: true, retractions: true, seams: true, toolChanges: true, pauses: true });
      host.fit(near);
    },
  },
  'colour-feature': valueCase(() => undefined),
  'colour-height': valueCase((host) => host.setColour('height')),
  'colour-width': valueCase((host) => host.setColour('width')),
  'colour-feed': valueCase((host) => host.setColour('feed')),
  'colour-speed': valueCase((host) => host.setColour('speed')),
  'colour-accel': valueCase((host) => host.setColour('accel')),
  'colour-flow-asked': valueCase((host) => host.setColour('flowAsked')),
  'colour-flow': valueCase((host) => host.setColour('flow')),
  'colour-temperature': valueCase((host) => host.setColour('temperature')),
  'colour-fan': valueCase((host) => host.setColour('fan')),
  'colour-layer-time': valueCase((host) => host.setColour('layerTime')),
  'colour-tool': valueCase((host) => host.setColour('tool')),
  'colour-object': valueCase((host) => host.setColour('object')),
  // Half of the channels are missing: what they would say is not known.
  'colour-partly': {
    make: () => {
      const made = values();
      const words = made.channels.length / 2;
      return { ...made, channels: made.channels.fill(0, words - (words % 4)) };
    },
    look: (host) => {
      host.fit(near);
      host.setColour('speed');
    },
  },
  'own-range': valueCase((host) => {
    host.setColour('speed');
    host.setColourRange('speed', [90, 110]);
  }),
  'moves-of-a-layer': {
    make: values,
    look: (host) => {
      // Of the third layer the the second post but for its start, and the outer wall of the third but for its end.
      host.show({ layerTo: 2, vertexFrom: 122, vertexTo: 133 });
      host.fit(near);
      host.zoom(0.5, [0, 20]);
    },
  },
  printed: valueCase((host) => host.setPrintedUpTo(200)),
  'hidden-object': valueCase((host) => host.show({ hiddenObjects: [3] })),
  'marked-object': valueCase((host) => host.setHighlightedObject(2)),
  'marked-segment': valueCase((host) => host.setHighlight(302)),
  'out-of-round': valueCase((host) => host.setVolume({ min: [2, -5, 0], max: [22, 20, 8], isRound: true })),
  'out-of-volume': valueCase((host) => host.setVolume({ min: [2, -5, 0], max: [22, 20, 1.6] })),
  orthographic: valueCase((host) => {
    host.setProjection('orthographic');
    host.setCamera('front');
  }),
  top: valueCase((host) => host.setCamera('top')),
  mesh: {
    make: joints,
    look: (host) => {
      host.setBed({ minMm: [-10, -10], maxMm: [30, 30] });
      const at = [-2, -1, 0, 1, 2];
      host.setMesh({
        originMm: [-8, -8],
        stepMm: [9, 9],
        columns: 5,
        rows: 5,
        heightsMm: at.flatMap((y) => at.map((x) => 0.02 * (x * x - y * y))),
      });
      host.fit(near);
      host.zoom(3);
    },
  },
};
