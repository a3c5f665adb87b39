// Other viewers behind one face: a file in, then pictures of it from all sides. Which one: the address' query.
//
// Each is used as its own examples do, on the main thread, for they have no other. A picture is done when the GPU has done
// it: a pixel is read back.
import { init } from 'gcode-preview';
import * as three from 'three';
import { GCodeLoader } from 'three/examples/jsm/loaders/GCodeLoader.js';

const viewer = new URLSearchParams(location.search).get('viewer');
const canvas = document.querySelector('#view');

function withGCodeLoader() {
  const renderer = new three.WebGLRenderer({ canvas, antialias: true });
  const scene = new three.Scene();
  const camera = new three.PerspectiveCamera(50, canvas.width / canvas.height, 0.1, 5000);
  const turned = new three.Group();
  // The loader lets the file's Z be the scene's Y.
  scene.add(turned);
  return {
    renderer,
    scene,
    camera,
    load(text) {
      turned.add(new GCodeLoader().parse(text));
    },
  };
}

function withGcodePreview(renderTubes) {
  const preview = init({ canvas, renderTubes, buildVolume: { x: 300, y: 300, z: 250 }, extrusionColor: 'hotpink', disableGradient: true });
  const { renderer, scene, camera } = preview;
  return {
    renderer,
    scene,
    camera,
    load(text) {
      preview.processGCode(text);
    },
    ...(renderTubes && { moves: () => preview.layers.reduce((sum, { commands }) => sum + commands.filter(({ gcode }) => /^g0?[0-3]$/.test(gcode)).length, 0) }),
    slide() {
      preview.endLayer = Math.floor(preview.layers.length / 2);
      preview.render();
    },
  };
}

const made =
  viewer === 'three GCodeLoader' ? withGCodeLoader() : withGcodePreview(viewer === 'gcode-preview tubes');

/** Draws, and waits until that is done. */
function draw(angle) {
  const { renderer, scene, camera } = made;
  const box = new three.Box3().setFromObject(scene);
  const centre = box.getCenter(new three.Vector3());
  const distance = Math.min(1500, box.getSize(new three.Vector3()).length());
  camera.position.set(centre.x + distance * Math.sin(angle), centre.y + 0.6 * distance, centre.z + distance * Math.cos(angle));
  camera.lookAt(centre);
  renderer.render(scene, camera);
  const gl = renderer.getContext();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}

/** Straight lines that the viewer made of the file. A tube has no number of its own: there the file's moves are counted. */
function segments() {
  if (made.moves) return made.moves();
  let count = 0;
  made.scene.traverse(({ isLineSegments, isLineSegments2, geometry }) => {
    if (isLineSegments2) count += geometry.attributes.instanceStart?.count ?? 0;
    else if (isLineSegments) count += Math.floor((geometry.index?.count ?? geometry.attributes.position?.count ?? 0) / 2);
  });
  return count;
}

document.querySelector('#file').onchange = async ({ target }) => {
  const began = performance.now();
  const said = { viewer };
  try {
    const text = await target.files[0].text();
    made.load(text);
    said.load_s = (performance.now() - began) / 1000;
    draw(0);
    said.first_frame_s = (performance.now() - began) / 1000;
    const full = performance.now();
    draw(0.01);
    said.full_frame_s = (performance.now() - full) / 1000;
    said.segments = segments();
  } catch (error) {
    said.failed = String(error);
  }
  window.loaded = said;
};

/** Turns the view for so long; frames a second. */
window.orbit = async (ms) => {
  const began = performance.now();
  let frames = 0;
  while (performance.now() - began < ms) {
    draw(frames * 0.02);
    frames += 1;
    await new Promise(requestAnimationFrame);
  }
  return (frames * 1000) / (performance.now() - began);
};
/** Shows half the layers; false where the viewer cannot. */
window.slide = () => {
  made.slide?.();
  return made.slide !== undefined;
};
window.isReady = true;
