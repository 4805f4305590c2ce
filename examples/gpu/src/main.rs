//! Traces exported nodes by the compute shaders of `bvh-core` and compares every hit with the processor's. Without a Vulkan device it
//! says so; a software one, such as Mesa's lavapipe, will do.
//!
//! `cargo run --release --manifest-path examples/gpu/Cargo.toml`

use bvh_search::bvh_core::export::{CompressedBvh, shaders};
use bvh_search::prelude::*;
use std::error::Error;
use wgpu::{BindGroupEntry, BufferUsages, PollType, ShaderSource};

/// Hills of triangles, and a sheet above one half of them.
fn scene() -> Result<Vec<Triangle>, Box<dyn Error>> {
    let point = |i: u32| {
        let x = (i % 81) as f32;
        let z = (i / 81 % 81) as f32;
        if i < 81 * 81 {
            [x, 3.0 * (x * 0.3).sin() * (z * 0.2).cos(), z]
        } else {
            [x * 0.5, 6.0 + 0.1 * z, z]
        }
    };
    let positions: Vec<[f32; 3]> = (0..2 * 81 * 81).map(point).collect();
    let cells = (0..positions.len() as u32).filter(|i| i % 81 < 80 && i / 81 % 81 < 80);
    let indices: Vec<[u32; 3]> = cells
        .flat_map(|i| [[i, i + 1, i + 81], [i + 82, i + 81, i + 1]])
        .collect();
    Ok(Triangle::from_mesh(&positions, &indices)?)
}

/// Rays of a picture of 256 × 256 pixels, from a corner above the scene.
fn rays() -> Result<Vec<Ray>, Box<dyn Error>> {
    let ray = |i: u16| {
        let x = f32::from(i % 256) / 257.3 - 0.51;
        let y = 0.49 - f32::from(i / 256) / 258.1;
        Ray::half_line([-20.0, 30.0, -20.0], [1.0 - x, y - 0.5, 1.0 + x])
    };
    Ok((0..=u16::MAX)
        .map(ray)
        .collect::<Result<_, _>>()?)
}

/// The hits of `rays` by a shader, as distances and objects.
fn trace(
    (device, queue): &(wgpu::Device, wgpu::Queue),
    source: ShaderSource,
    data: [&[u8]; 4],
    count: usize,
) -> Result<Vec<(f32, u32)>, Box<dyn Error>> {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    let buffer = |size: usize, usage| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: size as u64,
            usage,
            mapped_at_creation: false,
        })
    };
    let mut buffers: Vec<wgpu::Buffer> = data
        .iter()
        .map(|bytes| buffer(bytes.len(), BufferUsages::STORAGE | BufferUsages::COPY_DST))
        .collect();
    buffers
        .iter()
        .zip(data)
        .for_each(|(buffer, bytes)| queue.write_buffer(buffer, 0, bytes));
    buffers.push(buffer(8 * count, BufferUsages::STORAGE | BufferUsages::COPY_SRC));
    let read = buffer(8 * count, BufferUsages::COPY_DST | BufferUsages::MAP_READ);
    let entries: Vec<BindGroupEntry> = (0..)
        .zip(&buffers)
        .map(|(binding, buffer)| BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(count.div_ceil(64) as u32, 1, 1);
    }
    encoder.copy_buffer_to_buffer(&buffers[4], 0, &read, 0, 8 * count as u64);
    queue.submit([encoder.finish()]);
    read.slice(..)
        .map_async(wgpu::MapMode::Read, |mapped| mapped.expect("a mapped buffer"));
    device.poll(PollType::wait_indefinitely())?;
    let words: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&read.slice(..).get_mapped_range()?);
    Ok(words
        .into_iter()
        .map(|[t, object]| (f32::from_bits(t), object))
        .collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let Ok(adapter) = pollster::block_on(instance.request_adapter(&Default::default())) else {
        println!("no Vulkan device: nothing was traced");
        return Ok(());
    };
    println!("{}", adapter.get_info().name);
    let device = pollster::block_on(adapter.request_device(&Default::default()))?;
    let triangles = scene()?;
    let rays = rays()?;
    let boxes = boxes(&triangles);
    let tree = bake(&boxes, Duration::from_millis(500))?.tree;
    let expected: Vec<Option<Hit>> = rays
        .iter()
        .map(|ray| nearest_hit(&tree, &triangles, ray))
        .collect();
    let corners: Vec<f32> = triangles
        .iter()
        .flat_map(|t| t.0)
        .flat_map(|corner| corner.to_array())
        .collect();
    let of_ray =
        |ray: &Ray| [ray.origin().extend(ray.t_min()), ray.direction().extend(ray.t_max())];
    let of_rays: Vec<f32> = rays
        .iter()
        .flat_map(of_ray)
        .flat_map(|v| v.to_array())
        .collect();

    let nodes = tree.to_first_count();
    let compressed = CompressedBvh::new(&tree, &boxes)?;
    let pairs = tree.to_aila_laine();
    let wgsl = |text: &'static str| ShaderSource::Wgsl(text.into());
    let glsl = ShaderSource::Glsl {
        shader: shaders::AILA_LAINE.into(),
        stage: wgpu::naga::ShaderStage::Compute,
        defines: &[],
    };
    let boxes_of: (&[u8], &[u32]) = (bytemuck::cast_slice(&pairs), &tree.prim_ids);
    let binary: (&[u8], &[u32]) = (bytemuck::cast_slice(&nodes), &tree.prim_ids);
    let wide: (&[u8], &[u32]) = (bytemuck::cast_slice(&compressed.nodes), &compressed.prim_ids);
    for (name, source, (nodes, ids)) in [
        ("binary", wgsl(shaders::BINARY), binary),
        ("children's boxes", glsl, boxes_of),
        ("compressed", wgsl(shaders::COMPRESSED), wide),
    ] {
        let data = [
            nodes,
            bytemuck::cast_slice(ids),
            bytemuck::cast_slice(&corners),
            bytemuck::cast_slice(&of_rays),
        ];
        let found = trace(&device, source, data, rays.len())?;
        // Of two triangles at an edge, or of almost the same distance, either will do.
        let same = |((t, object), expected): (&(f32, u32), &Option<Hit>)| match expected {
            Some(hit) => (t - hit.t).abs() <= 1e-5 * hit.t,
            None => *object == u32::MAX,
        };
        let others = found
            .iter()
            .zip(&expected)
            .filter(|pair| !same(*pair))
            .count();
        let hits = expected.iter().flatten().count();
        println!(
            "{name}: {} bytes, {hits} of {} rays hit, {others} decided otherwise",
            nodes.len(),
            rays.len()
        );
        assert!(hits > rays.len() / 4 && others < 10, "the picture is another one");
    }
    Ok(())
}
