// How the wall of a map is drawn (for scene_3d.js). Its inside has the colours that the scope has seen, brightened; its
// outside, which no scope sees, is the back of the same triangles in one colour of tissue. Nothing is added: a gap is wall
// that was never seen, or has no depth.
'use strict';
window.haustra = window.haustra || {};
(() => {
  const OUTSIDE = new THREE.Color(0xd08f80), NO_COLOUR = 0xd9a79b;
  const SMOOTHINGS = 4;

  // The shading is that of the wall around, not of the steps of the voxels. Places stay.
  const smoothNormals = geometry => {
    geometry.computeVertexNormals();
    const normals = geometry.getAttribute('normal').array, index = geometry.index.array;
    for (let pass = 0; pass < SMOOTHINGS; ++pass) {
      const old = normals.slice();
      for (let t = 0; t + 2 < index.length; t += 3) {
        const [i, j, k] = [3 * index[t], 3 * index[t + 1], 3 * index[t + 2]];
        for (let c = 0; c < 3; ++c) {
          const sum = old[i + c] + old[j + c] + old[k + c];
          normals[i + c] += sum;
          normals[j + c] += sum;
          normals[k + c] += sum;
        }
      }
      geometry.normalizeNormals();
    }
  };

  // Of each vertex, how it lies from the nearest place of the line, across the line; zeros without one.
  const acrossLine = (positions, line) => {
    const across = new Float32Array(positions.length), count = line.length / 3, tangent = new THREE.Vector3();
    for (let v = 0; v < positions.length && count > 1; v += 3) {
      const [x, y, z] = [positions[v], positions[v + 1], positions[v + 2]];
      let best = 0, least = Infinity;
      for (let i = 0; i < line.length; i += 3) {
        const dx = x - line[i], dy = y - line[i + 1], dz = z - line[i + 2], d = dx * dx + dy * dy + dz * dz;
        if (d < least) { least = d; best = i; }
      }
      const a = Math.max(0, best - 3), b = Math.min(line.length - 3, best + 3);
      tangent.set(line[b] - line[a], line[b + 1] - line[a + 1], line[b + 2] - line[a + 2]).normalize();
      const offset = [x - line[best], y - line[best + 1], z - line[best + 2]];
      const along = offset[0] * tangent.x + offset[1] * tangent.y + offset[2] * tangent.z;
      across[v] = offset[0] - along * tangent.x;
      across[v + 1] = offset[1] - along * tangent.y;
      across[v + 2] = offset[2] - along * tangent.z;
    }
    return across;
  };

  // Takes the geometry: its colours and normals are for looking at. line: along the middle of the lumen, flat, or empty.
  // Returns how far the wall is from the line, in the mean.
  haustra.prepareWall = (geometry, line) => {
    smoothNormals(geometry);
    const across = acrossLine(geometry.getAttribute('position').array, line);
    geometry.setAttribute('across', new THREE.BufferAttribute(across, 3));
    const colour = geometry.getAttribute('color');
    // Endoscopes light what is near: the rest would drown in the dark.
    if (colour) for (let i = 0; i < colour.array.length; ++i) colour.array[i] = Math.pow(colour.array[i], 0.75);
    let sum = 0;
    for (let v = 0; v < across.length; v += 3) sum += Math.hypot(across[v], across[v + 1], across[v + 2]);
    return 3 * sum / Math.max(across.length, 3);
  };

  // is_cut: {value}, shared. In a cut the half of the wall on the near side of the line is left out; where there is no
  // line, all that is seen from its outside.
  haustra.wallMaterial = (has_colour, is_cut) => {
    const material = new THREE.MeshPhongMaterial({
      vertexColors: has_colour ? THREE.VertexColors : THREE.NoColors, color: has_colour ? 0xffffff : NO_COLOUR,
      side: THREE.DoubleSide, specular: 0x0c0c0c, shininess: 20,
    });
    material.onBeforeCompile = shader => {
      Object.assign(shader.uniforms, {is_cut, outside: {value: OUTSIDE}});
      shader.vertexShader = 'attribute vec3 across;\nvarying float nearness;\n' + shader.vertexShader.replace(
          '#include <project_vertex>', '#include <project_vertex>\n' +
          'nearness = -dot((modelViewMatrix * vec4(across, 0.0)).xyz, normalize(mvPosition.xyz));');
      shader.fragmentShader = 'uniform bool is_cut;\nuniform vec3 outside;\nvarying float nearness;\n' + shader.fragmentShader
          .replace('#include <clipping_planes_fragment>',
                   'if (is_cut && (nearness > 0.0 || (nearness == 0.0 && !gl_FrontFacing))) discard;')
          .replace('#include <color_fragment>', '#include <color_fragment>\nif (!gl_FrontFacing) diffuseColor.rgb = outside;');
    };
    return material;
  };
})();
