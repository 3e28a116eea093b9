//! A connection whose other end must take what it is sent: whoever reads more slowly than a least rate is cut off.
//!
//! Time counts only while the system takes no more bytes. It is paid for by the bytes that were taken, and a reader may
//! save up to a first time without any.

use std::io::{Error, ErrorKind, IoSlice, Result};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep};

/// A connection with a least rate of its reader.
#[derive(Debug)]
pub struct Paced<S> {
    stream: S,
    least_bytes_per_s: f64,
    most_savings: Duration,
    /// How long it may still be blocked.
    savings: Duration,
    /// Since when it has been blocked, and the timer that ends it.
    blocked: Option<(Instant, Pin<Box<Sleep>>)>,
}

impl<S> Paced<S> {
    /// `stream`, whose reader takes at least `least_bytes_per_s`, and may stand still for `grace` at first.
    pub fn new(stream: S, least_bytes_per_s: f64, grace: Duration) -> Paced<S> {
        Paced { stream, least_bytes_per_s, most_savings: grace, savings: grace, blocked: None }
    }

    /// Looks at what became of writing.
    fn paced(&mut self, context: &mut Context<'_>, written: Poll<Result<usize>>) -> Poll<Result<usize>> {
        match written {
            Poll::Ready(Ok(count)) => {
                if let Some((since, _)) = self.blocked.take() {
                    self.savings = self.savings.saturating_sub(since.elapsed());
                }
                let earned = Duration::from_secs_f64(count as f64 / self.least_bytes_per_s);
                self.savings = self.savings.saturating_add(earned).min(self.most_savings);
                Poll::Ready(Ok(count))
            }
            Poll::Pending => {
                let savings = self.savings;
                let (_, timer) = self.blocked.get_or_insert_with(|| {
                    let now = Instant::now();
                    (now, Box::pin(tokio::time::sleep_until(now + savings)))
                });
                ready!(timer.as_mut().poll(context));
                Poll::Ready(Err(Error::new(ErrorKind::TimedOut, "the other end reads too slowly")))
            }
            failed => failed,
        }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Paced<S> {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, buffer: &mut ReadBuf<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Paced<S> {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.paced(context, written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(context, slices);
        self.paced(context, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::pin::pin;

    /// Takes as many bytes as it has room for.
    struct Narrow {
        room: usize,
    }

    impl AsyncWrite for Narrow {
        fn poll_write(mut self: Pin<&mut Self>, _: &mut Context<'_>, bytes: &[u8]) -> Poll<Result<usize>> {
            let count = bytes.len().min(self.room);
            self.room -= count;
            if count == 0 { Poll::Pending } else { Poll::Ready(Ok(count)) }
        }

        fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Result<()>> {
            Poll::Ready(Ok(()))
        }

        fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Result<()>> {
            Poll::Ready(Ok(()))
        }
    }

    /// What a write gives, tried now.
    async fn write(paced: &mut Paced<Narrow>, count: usize) -> Poll<Result<usize>> {
        let bytes = vec![0; count];
        std::future::poll_fn(|context| Poll::Ready(pin!(&mut *paced).poll_write(context, &bytes))).await
    }

    fn is_cut(written: Poll<Result<usize>>) -> bool {
        matches!(written, Poll::Ready(Err(error)) if error.kind() == ErrorKind::TimedOut)
    }

    /// Times are a tenth of a second or several; a machine may be late, but never early.
    #[tokio::test]
    async fn bytes_that_are_taken_pay_for_standing_still() {
        let grace = Duration::from_millis(200);
        let mut paced = Paced::new(Narrow { room: 100 }, 1000.0, grace);
        assert!(matches!(write(&mut paced, 60).await, Poll::Ready(Ok(60))));
        assert!(matches!(write(&mut paced, 60).await, Poll::Ready(Ok(40))));
        assert!(write(&mut paced, 60).await.is_pending());
        tokio::time::sleep(Duration::from_millis(150)).await;
        // 50 bytes pay for a twentieth of a second more.
        paced.stream.room = 50;
        assert!(matches!(write(&mut paced, 60).await, Poll::Ready(Ok(50))));
        assert!(paced.savings <= Duration::from_millis(100), "{:?}", paced.savings);
        assert!(write(&mut paced, 60).await.is_pending());
        tokio::time::sleep(Duration::from_millis(110)).await;
        assert!(is_cut(write(&mut paced, 60).await));
    }

    #[tokio::test]
    async fn an_idle_connection_is_not_a_slow_one() {
        let mut paced = Paced::new(Narrow { room: 100 }, 1000.0, Duration::from_millis(50));
        tokio::time::sleep(Duration::from_millis(150)).await;
        assert!(matches!(write(&mut paced, 60).await, Poll::Ready(Ok(60))));
        assert_eq!(paced.savings, Duration::from_millis(50));
    }
}
