// A map in 3D: points, surface (wall.js), path of the scope, and the scope where it is (three.js, its OrbitControls and its
// wide lines). Positions are those of the map, flat arrays of x y z; orientations are quaternions x y z w, map_from_cam, with
// the camera's axes x right, y down, z forward. Nothing is drawn while nothing changes.
'use strict';
window.haustra = window.haustra || {};
(() => {
  // On the dark ground of the scene, told apart also with a weakness for red and green (Okabe and Ito).
  // Never seen is blue from inside, where the dark is what is far.
  const COLOURS = {ground: 0x141a22, never: 0x2f5d8c, way: 0x6f8ba3, travelled: 0x56b4e9, loss: 0xe69f00, scope: 0xf0e442, truth: 0xffffff};
  const FIELD_OF_VIEW_DEG = 40, SCOPE_FIELD_OF_VIEW_DEG = 100;
  const LIGHT_REACH_RADII = 14, STEP_OF_WHEEL = 0.01;

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
      this.onLook = () => {};
      this.look = 'cut';  // or outside, along (the lumen), scope: through it
      this.line = [];     // along the middle of the lumen, where the wall is drawn
      this.along = 0.5;   // share of the line
      this.reach = 0;     // of the light inside it
      this.is_turned = false;
      try {
        this.renderer = new THREE.WebGLRenderer({antialias: true});
      } catch (error) {
        place.classList.add('no-webgl');
        place.textContent = 'This browser shows no 3D (WebGL is switched off or missing).';
        return;
      }
      this.renderer.setPixelRatio(window.devicePixelRatio);
      place.append(this.renderer.domElement);
      this.scene = new THREE.Scene();
      this.root = new THREE.Group();  // turns and shifts the map to its principal axes
      this.scene.add(this.root);
      this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW_DEG, 1, 0.01, 1000);
      this.scope_camera = new THREE.PerspectiveCamera(SCOPE_FIELD_OF_VIEW_DEG, 1, 0.001, 1000);
      this.head_light = new THREE.PointLight(0xffffff, 0.8);
      this.ambient_light = new THREE.AmbientLight(0xffffff, 0.42);
      this.scene.add(this.ambient_light, this.head_light);
      this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
      this.controls.addEventListener('change', () => this.draw());
      place.addEventListener('wheel', event => {
        if (this.shown_look !== 'along' || !this.controls.enableZoom) return;
        event.preventDefault();
        this.setAlong(this.along - STEP_OF_WHEEL * Math.sign(event.deltaY) * (this.is_turned ? -1 : 1));
      }, {passive: false});
      this.dot = roundDot();
      this.materials = new Map();  // of lines and points, which come anew with every look: shaders are compiled once
      this.layers = {points: true, surface: true, path: true, scope: true, pins: true};
      this.pins = new haustra.Pins(place);
      this.parts = {points: new THREE.Group(), surface: new THREE.Group(), path: new THREE.Group(), scope: new THREE.Group()};
      for (const part of Object.values(this.parts)) this.root.add(part);
      this.is_cut = {value: false};
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
      if (part !== 'surface') return;
      [this.line, this.reach] = [[], 0];
      this.onLook();
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

    // Takes a BufferGeometry whose front is what the scope sees. line: along the middle of its lumen, flat; empty: not known.
    addSurface(geometry, line = []) {
      if (!this.works) return;
      const radius = haustra.prepareWall(geometry, line);
      const has_colour = geometry.getAttribute('color') !== undefined;
      this.parts.surface.add(new THREE.Mesh(geometry, this.materialOf('surface ' + has_colour,
                                                                      () => haustra.wallMaterial(has_colour, this.is_cut))));
      if (line.length > this.line.length) [this.line, this.reach] = [line, LIGHT_REACH_RADII * radius];
      this.setLook(this.look);
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

    hasWall() { return this.works && this.parts.surface.children.length > 0; }
    canLook(look) { return look === 'along' ? this.line.length > 6 : look !== 'cut' || this.hasWall(); }

    // What cannot be shown now is as if it were outside, until it can.
    get shown_look() {
      if (!this.canLook(this.look) || (this.look === 'scope' && !this.has_scope)) return 'outside';
      return this.look;
    }
    get is_inside() { return this.shown_look === 'along' || this.shown_look === 'scope'; }

    setLook(look) {
      this.look = look;
      this.onLook();
      this.draw();
    }

    // share: of the line, from where it begins.
    setAlong(share) {
      this.along = Math.min(Math.max(share, 0), 1);
      this.setLook(this.look);
    }

    turnRound() {
      this.is_turned = !this.is_turned;
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

    // On the line, between its places, looking where it leads.
    placeAlong(camera) {
      const last = countOf(this.line) - 1;
      const at = share => {
        const i = Math.min(Math.max(share, 0), 1) * last, k = Math.min(Math.floor(i), last - 1);
        return vectorAt(this.line, k).lerp(vectorAt(this.line, k + 1), i - k).applyMatrix4(this.root.matrixWorld);
      };
      const ahead = 3 / last, way = at(this.along + ahead).sub(at(this.along - ahead)).multiplyScalar(this.is_turned ? -1 : 1);
      camera.position.copy(at(this.along));
      // As when it is seen from the side: what is above there is above here.
      camera.up.set(0, 1, 0);
      camera.lookAt(camera.position.clone().add(way));
    }

    drawNow() {
      const look = this.shown_look, through = look === 'scope', is_inside = this.is_inside;
      for (const [name, part] of Object.entries(this.parts)) part.visible = this.layers[name];
      this.parts.scope.visible = this.layers.scope && this.has_scope && !is_inside;
      // They would hide what is to be seen; the path would run through the eye.
      this.parts.path.visible = this.layers.path && !is_inside;
      this.root.updateMatrixWorld(true);
      const camera = is_inside ? this.scope_camera : this.camera;
      if (look === 'along') this.placeAlong(camera);
      if (through) {
        camera.position.copy(this.parts.scope.position).applyMatrix4(this.root.matrixWorld);
        // three.js looks along -z, with y up.
        camera.quaternion.copy(this.root.quaternion).multiply(this.parts.scope.quaternion)
            .multiply(new THREE.Quaternion(1, 0, 0, 0));
      }
      this.controls.enabled = !is_inside;
      this.is_cut.value = look === 'cut';
      this.renderer.setClearColor(is_inside && this.layers.surface && this.hasWall() ? COLOURS.never : COLOURS.ground);
      // Outside it comes from above the left shoulder: folds have a shade. Inside it is at the eye and does not reach far.
      camera.updateMatrixWorld(true);
      const distance = is_inside ? 0 : camera.position.distanceTo(this.controls.target);
      this.head_light.position.set(-0.35 * distance, 0.45 * distance, 0).applyMatrix4(camera.matrixWorld);
      this.head_light.distance = is_inside ? this.reach : 0;
      this.head_light.intensity = is_inside ? 1.0 : 0.8;
      this.ambient_light.intensity = is_inside ? 0.12 : 0.42;
      this.renderer.render(this.scene, camera);
      this.pins.draw(camera, this.root, this.layers.pins, through);
      this.place.dataset.drawn = this.renderer.info.render.triangles + this.renderer.info.render.points;
      this.place.dataset.look = look;
      this.onDrawn(this);
    }
  }

  haustra.Scene3D = Scene3D;
  haustra.SCENE_COLOURS = COLOURS;
})();
