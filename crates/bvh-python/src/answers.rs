//! The answers to batches of rays and points, on all threads.

use crate::arrays::{Column, Rows};
use crate::precision::{Point, Real};
use crate::rays::{RaySource, Selection};
use crate::sky::Views;
use crate::threads::Query;
use bvh_search::bvh_core::{Traced, neighbours};
use bvh_search::prelude::*;
use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::mem;

/// Numbers in the precision of the tree.
pub type Reals<'py> = Bound<'py, PyAny>;

/// The number of rays that a thread traces at once.
const BATCH: usize = 1024;
/// The number of rays or points that a thread answers at once where one may take long.
const FEW: usize = 128;

/// A call to a tracer.
pub struct Call<'a, 'py, N: Real> {
    pub py: Python<'py>,
    pub progress: Option<Py<PyAny>>,
    pub layout: &'a N::Layout,
    /// The triangles of the layout by their indices.
    pub triangles: &'a [N::Triangle],
}

impl<'py, N: Real> Call<'_, 'py, N> {
    pub fn nearest(
        self,
        source: &RaySource,
        select: &Selection,
        hint: Hint,
    ) -> PyResult<(Reals<'py>, Column<'py, i32>)> {
        let Self { py, progress, layout, triangles } = self;
        let (t, objects) = Query::ask(py, progress, source.rays.div_ceil(BATCH), |query| {
            let mut t = vec![N::default(); source.rays];
            let mut objects = vec![0; source.rays];
            let parts = t.par_chunks_mut(BATCH).zip(objects.par_chunks_mut(BATCH));
            query.answer(parts, |number, (t, objects)| {
                let rays = source.batch::<N>(number, BATCH)?;
                let how = (select.batch(number, BATCH, rays.len()), hint.coherence::<N>(&rays));
                let hits = N::nearest((layout, triangles), &rays, how);
                for ((hit, t), object) in hits.iter().zip(t).zip(objects) {
                    (*t, *object) = N::parts(hit);
                }
                Ok(())
            })?;
            Ok((t, objects))
        })?;
        Ok((t.into_pyarray(py).into_any(), objects.into_pyarray(py)))
    }

    pub fn any(
        self,
        source: &RaySource,
        select: &Selection,
        hint: Hint,
    ) -> PyResult<Column<'py, bool>> {
        let scene = (self.layout, self.triangles);
        self.columns(source.rays, BATCH, |number, hits| {
            let rays = source.batch::<N>(number, BATCH)?;
            let how = (select.batch(number, BATCH, rays.len()), hint.coherence::<N>(&rays));
            N::any(scene, &rays, how, hits);
            Ok(())
        })
    }

    pub fn all(
        self,
        source: &RaySource,
    ) -> PyResult<(Reals<'py>, Column<'py, i32>, Column<'py, i64>)> {
        let Self { py, progress, layout, .. } = self;
        let parts = source.rays.div_ceil(FEW);
        let (t, objects, numbers) = Query::ask(py, progress, parts, |query| {
            let mut found = vec![(Vec::new(), Vec::new()); parts];
            query.answer(found.par_iter_mut(), |number, (hits, counts)| {
                let rays = source.batch::<N>(number, FEW)?;
                *counts = vec![0; rays.len()];
                N::all(layout, &rays, hits, counts);
                Ok(())
            })?;
            let hits = found.iter().map(|(hits, _)| hits.len()).sum();
            let mut t = Vec::with_capacity(hits);
            let mut objects = Vec::with_capacity(hits);
            let mut numbers = Vec::with_capacity(hits);
            let mut number = 0;
            for (hits, counts) in found {
                query.go_on()?;
                t.extend(hits.iter().map(|hit| N::parts(hit).0));
                objects.extend(hits.iter().map(|hit| N::parts(hit).1));
                for count in counts {
                    numbers.extend((0..count).map(|_| number));
                    number += 1;
                }
            }
            Ok((t, objects, numbers))
        })?;
        Ok((t.into_pyarray(py).into_any(), objects.into_pyarray(py), numbers.into_pyarray(py)))
    }

    pub fn counts(self, source: &RaySource) -> PyResult<Column<'py, u32>> {
        let layout = self.layout;
        self.columns(source.rays, FEW, |number, counts| {
            N::all(layout, &source.batch::<N>(number, FEW)?, &mut Vec::new(), counts);
            Ok(())
        })
    }

    /// Returns one answer per point; `answer` writes those of some points.
    pub fn of_points<T: numpy::Element + Clone + Default>(
        self,
        points: &[Point<N>],
        answer: impl Fn(&N::Layout, &[Point<N>], &mut [T]) + Sync,
    ) -> PyResult<Column<'py, T>> {
        let layout = self.layout;
        self.columns(points.len(), FEW, |part, answers| {
            answer(layout, &points[part * FEW..][..answers.len()], answers);
            Ok(())
        })
    }

    pub fn closest(
        self,
        points: &[Point<N>],
    ) -> PyResult<(Rows<'py, f64>, Column<'py, i32>, Column<'py, f64>)> {
        let Self { py, progress, layout, .. } = self;
        let answer = |query: &Query| {
            let mut positions = vec![f64::NAN; 3 * points.len()];
            let mut objects = vec![-1; points.len()];
            let mut distances = vec![f64::INFINITY; points.len()];
            let parts = (
                positions.par_chunks_mut(3 * FEW),
                objects.par_chunks_mut(FEW),
                distances.par_chunks_mut(FEW),
                points.par_chunks(FEW),
            );
            query.answer(parts.into_par_iter(), |_, (positions, objects, distances, points)| {
                let mut closest = [None; FEW];
                let closest = &mut closest[..points.len()];
                layout.closest_to(points, closest);
                let positions = positions.as_chunks_mut().0;
                for (((closest, position), object), distance) in
                    closest.iter().zip(positions).zip(objects).zip(distances)
                {
                    if let Some(closest) = closest {
                        *position = closest.point.to_array();
                        *object = closest.object as i32;
                        *distance = closest.distance;
                    }
                }
                Ok(())
            })?;
            Ok((positions, objects, distances))
        };
        let (positions, objects, distances) =
            Query::ask(py, progress, points.len().div_ceil(FEW), answer)?;
        let positions = positions.into_pyarray(py).reshape([points.len(), 3])?;
        Ok((positions, objects.into_pyarray(py), distances.into_pyarray(py)))
    }

    /// Returns a row of answers for each point; `answer` writes it by the point's number and the
    /// bits of the directions that are free.
    pub fn visible<T: numpy::Element + Clone + Default>(
        self,
        views: &Views<N>,
        answer: impl Fn(usize, &[u64], &mut [T]) + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let Self { py, progress, layout, .. } = self;
        let view = views.view();
        let count = view.points.len();
        let width = views.shape[1..].iter().product::<usize>();
        let answers = Query::ask(py, progress, count.div_ceil(FEW), |query| {
            let mut answers = Vec::new();
            let fault =
                |_| format!("points: {count} rows of {width} answers do not fit into memory");
            answers.try_reserve_exact(count.saturating_mul(width)).map_err(fault)?;
            answers.resize(count * width, T::default());
            let order = neighbours(view.points);
            // Neighbours are answered together, each in its own row.
            let mut rows: Vec<&mut [T]> = answers.chunks_mut(width.max(1)).collect();
            rows.resize_with(count, Default::default);
            let ordered = order.iter().map(|&point| mem::take(&mut rows[point as usize]));
            let mut ordered: Vec<&mut [T]> = ordered.collect();
            let parts = ordered.par_chunks_mut(FEW).zip(order.par_chunks(FEW));
            query.answer(parts, |_, (answers, order)| {
                let mut answers = answers.iter_mut();
                views.sky.visible(layout, view, order, |point, row| {
                    answers.next().into_iter().for_each(|to| answer(point, row, to));
                });
                Ok(())
            })?;
            Ok(answers)
        })?;
        Ok(answers.into_pyarray(py).reshape(&views.shape[..])?.into_any())
    }

    /// Answers with the weights and normals of the triangles with these indices, or −1.
    pub fn surfaces(
        self,
        source: &RaySource,
        indices: &[i64],
    ) -> PyResult<(Column<'py, f64>, Column<'py, f64>, Reals<'py>)> {
        let Self { py, triangles, .. } = self;
        let (u, v, normals) = Query::ask(py, None, source.rays.div_ceil(BATCH), |query| {
            let mut u = vec![0.0; source.rays];
            let mut v = vec![0.0; source.rays];
            let mut normals = vec![N::default(); 3 * source.rays];
            let parts = (
                u.par_chunks_mut(BATCH),
                v.par_chunks_mut(BATCH),
                normals.par_chunks_mut(3 * BATCH),
                indices.par_chunks(BATCH),
            );
            query.answer(parts.into_par_iter(), |number, (u, v, normals, indices)| {
                let rays = source.batch::<N>(number, BATCH)?;
                let normals = normals.as_chunks_mut().0;
                for ((((ray, &index), u), v), normal) in
                    rays.iter().zip(indices).zip(u).zip(v).zip(normals)
                {
                    if let Some(triangle) = triangles.get(index as usize) {
                        ([_, *u, *v], *normal) = N::surface(triangle, ray);
                    }
                }
                Ok(())
            })?;
            Ok((u, v, normals))
        })?;
        let normals = normals.into_pyarray(py).reshape([source.rays, 3])?;
        Ok((u.into_pyarray(py), v.into_pyarray(py), normals.into_any()))
    }

    /// Returns one answer per ray or point; `answer` writes the answers of a part of them, by its
    /// number.
    fn columns<T: numpy::Element + Clone + Default>(
        self,
        count: usize,
        part: usize,
        answer: impl Fn(usize, &mut [T]) -> Result<(), String> + Sync,
    ) -> PyResult<Column<'py, T>> {
        let answers = Query::ask(self.py, self.progress, count.div_ceil(part), |query| {
            let mut answers = vec![T::default(); count];
            query.answer(answers.par_chunks_mut(part), &answer)?;
            Ok(answers)
        })?;
        Ok(answers.into_pyarray(self.py))
    }
}

/// Whether the rays of a batch are similar.
#[derive(Clone, Copy)]
pub struct Hint {
    /// What the caller says.
    pub coherent: Option<bool>,
    /// The diagonal of the scene.
    pub size: f64,
}

impl Hint {
    /// Returns what the caller says, or else what suits the rays.
    fn coherence<N: Real>(self, rays: &[N::Ray]) -> Coherence {
        /// The least cosine of the angle between similar directions.
        const SIMILAR: f64 = 0.97;
        /// The largest distance of close origins, in diagonals of the scene.
        const CLOSE: f64 = 0.05;
        let is_coherent = self.coherent.unwrap_or_else(|| {
            let pairs = rays.windows(2).step_by(16);
            let similar = pairs.clone().filter(|pair| {
                let [[a, from], [b, to]] = [&pair[0], &pair[1]].map(|ray| {
                    let [origin, direction] = N::ends(ray);
                    [direction, origin]
                });
                a.dot(b) >= SIMILAR * a.length() * b.length()
                    && from.distance(to) <= CLOSE * self.size
            });
            4 * similar.count() >= 3 * pairs.len().max(1)
        });
        if is_coherent { Coherence::Coherent } else { Coherence::Incoherent }
    }
}
