// A map in 3D: points, surface, path of the scope, and the scope where it is (three.js, its OrbitControls and its wide
// lines). Positions are those of the map, flat arrays of x y z; orientations are quaternions x y z w, map_from_cam, with
// the camera's axes x right, y down, z forward. Nothing is drawn while nothing changes.
'use strict';
window.haustra = window.haustra || {};
(() => {
  // On the dark ground of the scene, told apart also with a weakness for red and green (Okabe and Ito).
  const COLOURS = {ground: 0x141a22, way: 0x6f8ba3, travelled: 0x56b4e9, loss: 0xe69f00, scope: 0xf0e442, truth: 0xffffff};
  const FIELD_OF_VIEW_DEG = 40, SCOPE_FIELD_OF_VIEW_DEG = 100;

  const vectorAt = (array, i) => new THREE.Vector3(array[3 * i], array[3 * i + 1], array[3 * i + 2]);
  const countOf = array => Math.floor(array.length / 3);

  const roundDot = () => {
    const canvas = document.createElement('canvas');
    canvas.width = canvas.height = 32;
    const context = canvas.getContext('2d');
    context.fillStyle = '#fff';
    context.beginPath();
    context.arc(16, 16, 15, 0, 2 * Math.PI);
    context.fill();
    return new THREE.CanvasTexture(canvas);
  };

  // Rows: the axes of largest, middle and smallest extent, right-handed, the first one from where `positions` begin to
  // where they end. By Jacobi's rotations.
  const principalAxes = (positions, centre) => {
    const a = [[0, 0, 0], [0, 0, 0], [0, 0, 0]], v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    for (const p of positions) {
      const d = [p.x - centre.x, p.y - centre.y, p.z - centre.z];
      for (let i = 0; i < 3; ++i) for (let j = 0; j < 3; ++j) a[i][j] += d[i] * d[j];
    }
    for (let sweep = 0; sweep < 30; ++sweep) {
      for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
        if (Math.abs(a[p][q]) < 1e-300) continue;
        const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.sqrt(theta * theta + 1));
        const c = 1 / Math.sqrt(t * t + 1), s = t * c;
        for (let k = 0; k < 3; ++k) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
        for (let k = 0; k < 3; ++k) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
        for (let k = 0; k < 3; ++k) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
      }
    }
    const order = [0, 1, 2].sort((i, j) => a[j][j] - a[i][i]);
    const axes = order.map(i => new THREE.Vector3(v[0][i], v[1][i], v[2][i]).normalize());
    const along = positions[positions.length - 1].clone().sub(positions[0]);
    if (axes[0].dot(along) < 0) axes[0].negate();
    axes[2].crossVectors(axes[0], axes[1]).normalize();
    return axes;
  };

  const quantiles = (values, low, high) => {
    values.sort((x, y) => x - y);
    return [values[Math.floor(low * (values.length - 1))], values[Math.ceil(high * (values.length - 1))]];
  };

  class Scene3D {
    // `place` is an element with a size; it gets a canvas, or a sentence where the browser has no WebGL.
    constructor(place) {
      this.place = place;
      this.onDrawn = () => {};
      try {
        this.renderer = new THREE.WebGLRenderer({antialias: true});
      } catch (error) {
        place.classList.add('no-webgl');
        place.textContent = 'This browser shows no 3D (WebGL is switched off or missing).';
        return;
      }
      this.renderer.setClearColor(COLOURS.ground);
      this.renderer.setPixelRatio(window.devicePixelRatio);
      place.append(this.renderer.domElement);
      this.scene = new THREE.Scene();
      this.root = new THREE.Group();  // turns and shifts the map to its principal axes
      this.scene.add(this.root);
      this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.01, 1000);
      this.scope_camera = new THREE.PerspectiveCamera(SCOPE_FIELD_OF_VIEW_DEG, 1, 0.001, 1000);
      this.head_light = new THREE.PointLight(0xffffff, 0.75);
      this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f98, 0.85), this.head_light);
      this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
      this.controls.addEventListener('change', () => this.draw());
      this.dot = roundDot();
      this.materials = new Map();  // of lines and points, which come anew with every look: shaders are compiled once
      this.layers = {points: true, surface: true, path: true, scope: true, pins: true};
      this.pins = new haustra.Pins(place);
      this.parts = {points: new THREE.Group(), surface: new THREE.Group(), path: new THREE.Group(), scope: new THREE.Group()};
      for (const part of Object.values(this.parts)) this.root.add(part);
      this.is_inside = false;
      this.has_scope = false;
      this.extent = 1;
      if (window.ResizeObserver) new ResizeObserver(() => this.resize()).observe(place);
      window.addEventListener('resize', () => this.resize());
      this.resize();
    }

    get works() { return this.renderer !== undefined; }

    resize() {
      const width = Math.max(1, this.place.clientWidth), height = Math.max(1, this.place.clientHeight);
      this.renderer.setSize(width, height, false);
      for (const camera of [this.camera, this.scope_camera]) {
        camera.aspect = width / height;
        camera.updateProjectionMatrix();
      }
      this.parts.path.traverse(line => {
        if (line.material && line.material.resolution) line.material.resolution.set(width, height);
      });
      this.draw();
    }

    clear(part) {
      if (!this.works) return;
      for (const object of [...this.parts[part].children]) {
        this.parts[part].remove(object);
        if (object.geometry) object.geometry.dispose();
      }
    }

    materialOf(key, make) {
      if (!this.materials.has(key)) this.materials.set(key, make());
      return this.materials.get(key);
    }

    // rgb: three bytes a point, or null; then `colour` is that of all.
    addPoints(positions, rgb, colour = 0xcfd8e3) {
      if (!this.works || positions.length === 0) return;
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
      // Endoscopes light what is near: the rest would drown in the dark ground.
      if (rgb) {
        const bright = new Uint8Array(rgb.length);
        for (let i = 0; i < rgb.length; ++i) bright[i] = Math.round(255 * Math.pow(rgb[i] / 255, 0.7));
        geometry.setAttribute('color', new THREE.BufferAttribute(bright, 3, true));
      }
      this.parts.points.add(new THREE.Points(geometry, this.materialOf('points ' + (rgb ? 'rgb' : colour), () => new THREE.PointsMaterial({
        size: 3 * window.devicePixelRatio, sizeAttenuation: false, map: this.dot, alphaTest: 0.5,
        vertexColors: rgb ? THREE.VertexColors : THREE.NoColors, color: rgb ? 0xffffff : colour,
      }))));
      this.draw();
    }

    // A BufferGeometry with colours whose front is what the scope sees: of the wall between the eye and the lumen there is
    // only a breath, as in a cut.
    addSurface(geometry) {
      if (!this.works) return;
      if (!geometry.getAttribute('normal')) geometry.computeVertexNormals();
      const has_colour = geometry.getAttribute('color') !== undefined;
      this.parts.surface.add(new THREE.Mesh(geometry, this.materialOf('surface ' + has_colour, () => new THREE.MeshLambertMaterial({
        vertexColors: has_colour ? THREE.VertexColors : THREE.NoColors, color: has_colour ? 0xffffff : 0xd9a79b, side: THREE.FrontSide,
      }))));
      const near = new THREE.Mesh(geometry, this.materialOf('surface from behind', () => new THREE.MeshLambertMaterial({
        color: 0xd9b3a8, side: THREE.BackSide, transparent: true, opacity: 0.16, depthWrite: false,
      })));
      near.renderOrder = 1;
      this.parts.surface.add(near);
      this.draw();
    }

    // Pairs of ends, six numbers a segment. Returns what shortens it: a function of the number of segments to show.
    addLine(segments, colour = COLOURS.way, width_px = 2) {
      const count = Math.floor(segments.length / 6);
      if (!this.works || count === 0) return () => {};
      const geometry = new THREE.LineSegmentsGeometry();
      geometry.setPositions(segments);
      const material = this.materialOf('line ' + colour + ' ' + width_px, () => {
        // In front of everything: a path inside the wall is to be seen from outside, too.
        return new THREE.LineMaterial({color: colour, linewidth: width_px, depthTest: false, transparent: true});
      });
      material.resolution.set(this.place.clientWidth, this.place.clientHeight);
      const line = new THREE.LineSegments2(geometry, material);
      line.frustumCulled = false;
      line.renderOrder = 1 + this.parts.path.children.length;
      this.parts.path.add(line);
      this.draw();
      return number => {
        geometry.maxInstancedCount = number;
        line.visible = number > 0;
        this.draw();
      };
    }

    addMark(position, colour = COLOURS.loss) {
      if (!this.works) return;
      const mark = new THREE.Mesh(new THREE.SphereBufferGeometry(0.008 * this.extent, 16, 12),
                                  this.materialOf('mark ' + colour, () => new THREE.MeshBasicMaterial({color: colour, depthTest: false, transparent: true})));
      mark.renderOrder = 100;
      mark.position.copy(position);
      this.parts.path.add(mark);
    }

    // Places with a label (pins.js).
    setPins(pins) {
      if (!this.works) return;
      this.pins.set(pins);
      this.draw();
    }

    // The map lies along the window, all but the farthest points of it in sight. `path`: positions of the scope.
    frame(path, points) {
      if (!this.works) return;
      const way = [], step = Math.max(1, Math.floor(countOf(path) / 2000));
      for (let i = 0; i < countOf(path); i += step) way.push(vectorAt(path, i));
      const some = [], each = Math.max(1, Math.floor(countOf(points) / 8000));
      for (let i = 0; i < countOf(points); i += each) some.push(vectorAt(points, i));
      const all = way.concat(some);
      if (all.length === 0) return;
      const basis = way.length > 2 ? way : all, centre = new THREE.Vector3();
      for (const p of basis) centre.addScaledVector(p, 1 / basis.length);
      // A path that goes nowhere says nothing of how the map lies.
      let axes = principalAxes(basis, centre);
      const reach = list => Math.max(...list.map(p => p.distanceTo(centre)));
      if (basis === way && some.length > 2 && reach(way) < 0.2 * reach(some)) axes = principalAxes(all, centre);
      const turn = new THREE.Matrix4().set(axes[0].x, axes[0].y, axes[0].z, 0, axes[1].x, axes[1].y, axes[1].z, 0,
                                           axes[2].x, axes[2].y, axes[2].z, 0, 0, 0, 0, 1);
      const turned = list => list.map(p => p.clone().applyMatrix4(turn));
      const turned_way = turned(way), turned_points = turned(some);
      const box = ['x', 'y', 'z'].map(axis => {
        let [low, high] = turned_points.length > 0 ? quantiles(turned_points.map(p => p[axis]), 0.02, 0.98) : [Infinity, -Infinity];
        for (const p of turned_way) { low = Math.min(low, p[axis]); high = Math.max(high, p[axis]); }
        return [low, high];
      });
      const middle = box.map(([low, high]) => (low + high) / 2), size = box.map(([low, high]) => Math.max(high - low, 1e-9));
      this.extent = Math.max(...size);
      this.root.quaternion.setFromRotationMatrix(turn);
      this.root.position.set(-middle[0], -middle[1], -middle[2]);
      const half = Math.tan(FIELD_OF_VIEW_DEG * Math.PI / 360);
      const distance = 1.12 * Math.max(size[1] / 2 / half, size[0] / 2 / half / this.camera.aspect) + size[2] / 2;
      this.camera.position.set(-0.15 * distance, 0.25 * distance, 0.96 * distance);
      this.camera.near = 0.002 * distance;
      this.camera.far = 40 * distance;
      this.camera.updateProjectionMatrix();
      this.scope_camera.near = 0.0005 * this.extent;
      this.scope_camera.far = 40 * distance;
      this.scope_camera.updateProjectionMatrix();
      this.controls.target.set(0, 0, 0);
      this.controls.update();
      this.makeScope();
      this.draw();
    }

    makeScope() {
      this.clear('scope');
      const d = 0.05 * this.extent, w = 0.6 * d, h = 0.48 * d;
      const tip = [0, 0, 0], corners = [[-w, -h, d], [w, -h, d], [w, h, d], [-w, h, d]];
      const faces = [], edges = [];
      corners.forEach((corner, i) => {
        const next = corners[(i + 1) % 4];
        faces.push(...tip, ...corner, ...next);
        edges.push(...tip, ...corner, ...corner, ...next);
      });
      const solid = new THREE.BufferGeometry();
      solid.setAttribute('position', new THREE.BufferAttribute(new Float32Array(faces), 3));
      this.parts.scope.add(new THREE.Mesh(solid, new THREE.MeshBasicMaterial({
        color: COLOURS.scope, transparent: true, opacity: 0.35, side: THREE.DoubleSide, depthTest: false})));
      const wire = new THREE.BufferGeometry();
      wire.setAttribute('position', new THREE.BufferAttribute(new Float32Array(edges), 3));
      this.parts.scope.add(new THREE.LineSegments(wire, new THREE.LineBasicMaterial({color: COLOURS.scope, depthTest: false, transparent: true})));
      const tip_ball = new THREE.Mesh(new THREE.SphereBufferGeometry(0.16 * d, 16, 12),
                                      new THREE.MeshBasicMaterial({color: COLOURS.scope, depthTest: false, transparent: true}));
      this.parts.scope.add(tip_ball);
      this.parts.scope.traverse(part => { part.renderOrder = 200; });
    }

    // null: it is not known where the scope is.
    setScope(position, orientation) {
      if (!this.works) return;
      this.has_scope = position !== null;
      if (this.has_scope) {
        this.parts.scope.position.set(...position);
        this.parts.scope.quaternion.set(...orientation);
      }
      this.draw();
    }

    setLayer(name, is_shown) {
      this.layers[name] = is_shown;
      this.draw();
    }

    // Through the scope, or from outside.
    setInside(is_inside) {
      this.is_inside = is_inside;
      if (this.works) this.controls.enabled = !is_inside;
      this.draw();
    }

    // Pixels of one map unit at the middle of what is looked at.
    get px_per_unit() {
      const distance = this.camera.position.distanceTo(this.controls.target);
      return this.place.clientHeight / 2 / (distance * Math.tan(FIELD_OF_VIEW_DEG * Math.PI / 360));
    }

    draw() {
      if (!this.works || this.is_due) return;
      this.is_due = true;
      requestAnimationFrame(() => { this.is_due = false; this.drawNow(); });
    }

    drawNow() {
      const through = this.is_inside && this.has_scope;
      for (const [name, part] of Object.entries(this.parts)) part.visible = this.layers[name];
      this.parts.scope.visible = this.layers.scope && this.has_scope && !through;
      // The path would run through the eye.
      this.parts.path.visible = this.layers.path && !through;
      this.root.updateMatrixWorld(true);
      let camera = this.camera;
      if (through) {
        camera = this.scope_camera;
        camera.position.copy(this.parts.scope.position).applyMatrix4(this.root.matrixWorld);
        // three.js looks along -z, with y up.
        camera.quaternion.copy(this.root.quaternion).multiply(this.parts.scope.quaternion)
            .multiply(new THREE.Quaternion(1, 0, 0, 0));
      }
      this.head_light.position.copy(camera.position);
      this.renderer.render(this.scene, camera);
      this.pins.draw(camera, this.root, this.layers.pins, through);
      this.place.dataset.drawn = this.renderer.info.render.triangles + this.renderer.info.render.points;
      this.onDrawn(this);
    }
  }

  haustra.Scene3D = Scene3D;
  haustra.SCENE_COLOURS = COLOURS;
})();
