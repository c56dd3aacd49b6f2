// node three.mjs MODULES FILE.glb OUT: what Khronos's validator finds in a file, as JSON on the
// standard output, and where three.js shows its vertices at every key frame, as float64 in OUT.
import fs from 'node:fs'
import path from 'node:path'
import { createRequire } from 'node:module'
import { pathToFileURL } from 'node:url'

const [modules, file, out] = process.argv.slice(2)
const load = (name) => import(pathToFileURL(path.join(modules, name)).href)
const validator = createRequire(path.join(modules, 'x.js'))('gltf-validator')
const bytes = fs.readFileSync(file)
const report = await validator.validateBytes(new Uint8Array(bytes), { maxIssues: 20 })
console.log(JSON.stringify(report.issues))

const THREE = await load('three/build/three.module.js')
const { GLTFLoader } = await load('three/examples/jsm/loaders/GLTFLoader.js')
globalThis.self = globalThis
const content = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength)
const gltf = await new Promise((done, failed) => new GLTFLoader().parse(content, '', done, failed))
const mixer = new THREE.AnimationMixer(gltf.scene)
const action = mixer.clipAction(gltf.animations[0])
action.setLoop(THREE.LoopOnce)
action.clampWhenFinished = true
action.play()
let mesh
gltf.scene.traverse((node) => { if (node.isSkinnedMesh) mesh = node })
const times = gltf.animations[0].tracks[0].times
const count = mesh.geometry.attributes.position.count
const places = new Float64Array(times.length * count * 3)
const at = new THREE.Vector3()
times.forEach((time, frame) => {
  mixer.setTime(time)
  gltf.scene.updateMatrixWorld(true)
  for (let i = 0; i < count; i++) {
    mesh.getVertexPosition(i, at)
    at.applyMatrix4(mesh.matrixWorld)
    places.set([at.x, at.y, at.z], 3 * (frame * count + i))
  }
})
fs.writeFileSync(out, Buffer.from(places.buffer))
