// The bed's shape over the plate: whether it is shown, which one, and how many times as high as it is.
import { exaggerationOf, heightRange, RAMPS } from '@stepcast/toolpath';
import type { JSX } from 'preact';
import { meshes, meshInForce, meshInView, surfaceOf, wantedMesh } from '../../state/mesh';
import { change, settings } from '../../state/settings';
import { formatNumber } from '../numbers';
import { gradient } from './words';

/** The mesh that is shown: its heights as drawn. */
function Shown(): JSX.Element | null {
  const mesh = meshInView.value;
  if (!mesh) return null;
  const surface = surfaceOf(mesh);
  const [low, high] = heightRange(surface);
  return (
    <>
      <div class="scale-bar" style={{ background: gradient(RAMPS.light) }} aria-hidden="true" />
      <p class="scale-ends">
        <span>{formatNumber(low, 3)} mm</span>
        <span>{formatNumber(high, 3)} mm</span>
      </p>
      <p class="hint">Drawn {formatNumber(exaggerationOf(surface))} times as high.</p>
    </>
  );
}

function Which(): JSX.Element {
  const inForce = meshInForce.value;
  const mesh = meshInView.value;
  if (inForce !== null)
    return (
      <p class="hint">
        {mesh
          ? `“${inForce}”, which is in force.`
          : `“${inForce}” is in force; this machine file has no such mesh.`}
      </p>
    );
  return (
    <>
      {meshes.value.length > 1 && (
        <label class="field">
          Mesh
          <select
            value={mesh?.name ?? ''}
            onChange={(event) => {
              wantedMesh.value = event.currentTarget.value;
            }}
          >
            {meshes.value.map(({ name }) => (
              <option key={name} value={name}>
                {name}
              </option>
            ))}
          </select>
        </label>
      )}
      <p class="hint">“{mesh?.name}” of the machine file; it is not in force.</p>
    </>
  );
}

export function MeshPart(): JSX.Element | null {
  if (meshes.value.length === 0) return null;
  const { showMesh } = settings.value;
  return (
    <section class="legend-part" aria-label="Bed mesh of the machine">
      <label class="check">
        <input
          type="checkbox"
          checked={showMesh}
          onChange={(event) => change({ showMesh: event.currentTarget.checked })}
        />
        Bed mesh
      </label>
      {showMesh && (
        <>
          <Which />
          <Shown />
        </>
      )}
    </section>
  );
}

/** Over the empty plate: the same without a file's legend around it. */
export function MeshAlone(): JSX.Element | null {
  return meshes.value.length === 0 ? null : (
    <div class="legend mesh-alone">
      <MeshPart />
    </div>
  );
}
